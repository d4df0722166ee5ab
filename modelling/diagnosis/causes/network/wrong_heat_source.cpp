#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "wrong_heat_source";
constexpr CauseParameter factor{"factor", "1", 0.0, 10.0, "times what the model has:"};

std::vector<NetworkHypothesis> in_network(const NetworkMaterial& material,
                                          const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::source) return {};
  const NetworkSource& source = material.plant.network.sources[subject.index];
  if (source.heat_W == 0.0) return {};
  NetworkHypothesis wrong;
  wrong.hypothesis.cause = name;
  wrong.hypothesis.subject = material.plant.source_names[subject.index];
  wrong.hypothesis.form = Form::shared_gain;
  wrong.hypothesis.gains = {std::string(factor.name)};
  // The gain is what the factor is beyond 1.
  wrong.hypothesis.bounds = [](std::size_t) {
    return Interval{factor.low - 1.0, factor.high - 1.0};
  };
  wrong.apply = [index = subject.index](HeatNetwork& network, const Shape&, double gain) {
    network.sources[index].heat_W *= 1.0 + gain;
  };
  wrong.value = source.heat_W;
  wrong.key = "heat_W";
  return {std::move(wrong)};
}

bool into_machine(MachineFile& machine, const std::string& subject,
                  const std::vector<Parameter>& parameters) {
  return machine.multiply_in_source(two_names(subject), "heat_W",
                                    shared_value(parameters, "factor"));
}

}  // namespace

/// A source gives another heat for its signal.
Cause wrong_heat_source() {
  Cause cause{name, "heat"};
  cause.parameters = {factor, {.name = "heat_W", .unit = "W", .says = "heat"}};
  cause.texts = {
      "A source gives another heat", "this source gives another heat than the thermal model says",
      "Put the new heat_W into the thermal model; look at preload, load and speed of what warms."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = in_network;
  cause.into_machine = into_machine;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
