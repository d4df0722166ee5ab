#include <cmath>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "wrong_ambient";
constexpr CauseParameter offset{"offset_K", "K", -20.0, 20.0, "warmer by"};

NetworkHypothesis warmer(const std::string& subject, const Eigen::VectorXd& inflow) {
  NetworkHypothesis wrong;
  wrong.hypothesis.cause = name;
  wrong.hypothesis.subject = subject;
  wrong.hypothesis.form = Form::shared_gain;
  wrong.hypothesis.gains = {std::string(offset.name)};
  wrong.hypothesis.bounds = [](std::size_t) { return Interval{offset.low, offset.high}; };
  // Air that is warmer by so much brings in a constant heat.
  wrong.apply = [inflow](HeatNetwork& network, const Shape&, double gain) {
    network.sources.push_back({"", gain, 1.0, 1.0, inflow});
  };
  return wrong;
}

std::vector<NetworkHypothesis> in_network(const NetworkMaterial& material,
                                          const NetworkSubject& subject) {
  if (subject.kind == NetworkSubjectKind::room)
    return {warmer("room", material.plant.network.room_inflow)};
  if (subject.kind != NetworkSubjectKind::air_of_part) return {};
  const NetworkPart& part = material.plant.parts[subject.index];
  return {warmer(part.subject, part.inflow)};
}

}  // namespace

/// The air around the machine, or around one part of it, is not what the room's reading says.
Cause wrong_ambient() {
  Cause cause{name, "structure"};
  cause.parameters = {offset};
  cause.texts = {
      "The air here is not the room's",
      "the air around this is warmer or colder than the reading of the room",
      "Move the room's sensor to the air that the machine is in, or take the offset into account."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = in_network;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
