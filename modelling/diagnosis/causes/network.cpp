/// Errors of a thermal network.
#include <algorithm>
#include <initializer_list>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

/// Range of the factor on a value of the machine file.
constexpr CauseParameter factor_of_part{"factor", "1", 0.15, 7.0, "times what the model has:"};
constexpr std::size_t factors = 14;

void scale(HeatNetwork& network, const NetworkPart& part, double factor) {
  const double more = factor - 1.0;
  switch (part.kind) {
    case PartKind::room_film:
      network.conductance += more * part.matrix;
      network.room_inflow += more * part.inflow;
      break;
    case PartKind::coolant_film:
      network.coolant_conductance += more * part.matrix;
      network.coolant_inflow += more * part.inflow;
      break;
    case PartKind::joint:
      network.conductance += more * part.matrix;
      break;
    case PartKind::capacity:
      network.capacity += more * part.matrix;
      break;
  }
}

/// A wrong value of a part of one of these kinds.
std::vector<NetworkHypothesis> of_wrong_part(const NetworkMaterial& material,
                                             const NetworkSubject& subject,
                                             std::initializer_list<PartKind> kinds) {
  if (subject.kind != NetworkSubjectKind::part) return {};
  const NetworkPart& part = material.plant.parts[subject.index];
  if (std::find(kinds.begin(), kinds.end(), part.kind) == kinds.end()) return {};
  NetworkHypothesis wrong;
  wrong.hypothesis.subject = part.subject;
  wrong.hypothesis.form = Form::no_gain;
  wrong.hypothesis.shape = {{std::string(factor_of_part.name),
                             logarithmic_grid(factor_of_part.low, factor_of_part.high, factors),
                             true, false}};
  wrong.apply = [&part](HeatNetwork& network, const Shape& shape, double gain) {
    scale(network, part, 1.0 + gain * (shape[0] - 1.0));
  };
  wrong.value = part.value.value_or(0.0);
  wrong.key = part.key;
  return {std::move(wrong)};
}

constexpr CauseParameter source_factor{"factor", "1", 0.0, 10.0, "times what the model has:"};

std::vector<NetworkHypothesis> wrong_heat_source_in_network(const NetworkMaterial& material,
                                                            const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::source) return {};
  const NetworkSource& source = material.plant.network.sources[subject.index];
  if (source.heat_W == 0.0) return {};
  NetworkHypothesis wrong;
  wrong.hypothesis.subject = material.plant.source_names[subject.index];
  wrong.hypothesis.form = Form::shared_gain;
  wrong.hypothesis.gains = {std::string(source_factor.name)};
  // The gain is source_factor - 1.
  wrong.hypothesis.bounds = [](std::size_t) {
    return Interval{source_factor.low - 1.0, source_factor.high - 1.0};
  };
  wrong.apply = [index = subject.index](HeatNetwork& network, const Shape&, double gain) {
    network.sources[index].heat_W *= 1.0 + gain;
  };
  wrong.value = source.heat_W;
  wrong.key = "heat_W";
  return {std::move(wrong)};
}

bool wrong_heat_source_into_machine(MachineFile& machine, const std::string& subject,
                                    const std::vector<Parameter>& parameters) {
  return machine.multiply_in_source(two_names(subject), "heat_W",
                                    shared_value(parameters, "factor"));
}

/// The heat of a source is wrong.
Cause wrong_heat_source() {
  Cause cause{"wrong_heat_source", "heat"};
  cause.parameters = {source_factor, {.name = "heat_W", .unit = "W", .description = "heat"}};
  cause.texts = {
      "A source gives another heat", "this source gives another heat than the thermal model says",
      "Put the new heat_W into the thermal model; look at preload, load and speed of what warms."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = wrong_heat_source_in_network;
  cause.into_machine = wrong_heat_source_into_machine;
  return cause;
}

bool wrong_film_coefficient_into_machine(MachineFile& machine, const std::string& subject,
                                         const std::vector<Parameter>& parameters) {
  const TwoNames film = two_names(subject);
  return machine.multiply_in_node(film.first,
                                  film.second == "room" ? "room_W_per_K" : "coolant_W_per_K",
                                  shared_value(parameters, "factor"));
}

/// The conductance of a film to the air or to the coolant is wrong.
Cause wrong_film_coefficient() {
  Cause cause{"wrong_film_coefficient", "structure"};
  cause.parameters = {
      factor_of_part,
      {.name = "room_W_per_K", .unit = "W/K", .low = 0.0, .description = "to the air"},
      {.name = "coolant_W_per_K", .unit = "W/K", .low = 0.0, .description = "to the coolant"},
  };
  cause.texts = {
      "Air or coolant takes another heat",
      "this place gives another heat to the air or the coolant than the thermal model says",
      "Put the new value into the thermal model; look for a cover, a fan or a blocked jacket."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = [](const NetworkMaterial& material, const NetworkSubject& subject) {
    return of_wrong_part(material, subject, {PartKind::room_film, PartKind::coolant_film});
  };
  cause.into_machine = wrong_film_coefficient_into_machine;
  return cause;
}

bool wrong_conductance_into_machine(MachineFile& machine, const std::string& subject,
                                    const std::vector<Parameter>& parameters) {
  return machine.multiply_in_link(two_names(subject), "conductance_W_per_K",
                                  shared_value(parameters, "factor"));
}

/// The conductance of a joint is wrong.
Cause wrong_conductance() {
  Cause cause{"wrong_conductance", "structure"};
  cause.parameters = {
      factor_of_part,
      {.name = "conductance_W_per_K", .unit = "W/K", .low = 0.0, .description = "conducts"},
  };
  cause.texts = {
      "A joint conducts otherwise", "this joint conducts otherwise than the thermal model says",
      "Put the new value into the thermal model; look at pressure and flatness of the joint."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = [](const NetworkMaterial& material, const NetworkSubject& subject) {
    return of_wrong_part(material, subject, {PartKind::joint});
  };
  cause.into_machine = wrong_conductance_into_machine;
  return cause;
}

bool wrong_heat_capacity_into_machine(MachineFile& machine, const std::string& subject,
                                      const std::vector<Parameter>& parameters) {
  return machine.multiply_in_node(two_names(subject).first, "capacity_J_per_K",
                                  shared_value(parameters, "factor"));
}

/// The heat capacity of a place is wrong.
Cause wrong_heat_capacity() {
  Cause cause{"wrong_heat_capacity", "structure"};
  cause.parameters = {
      factor_of_part,
      {.name = "capacity_J_per_K", .unit = "J/K", .low = 0.0, .description = "stores"},
  };
  cause.texts = {
      "A place stores another heat", "this place stores another heat than the thermal model says",
      "Put the new value into the thermal model; look whether a mass was left out of it."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = [](const NetworkMaterial& material, const NetworkSubject& subject) {
    return of_wrong_part(material, subject, {PartKind::capacity});
  };
  cause.into_machine = wrong_heat_capacity_into_machine;
  return cause;
}

constexpr CauseParameter offset{"offset_K", "K", -20.0, 20.0, "warmer by"};

NetworkHypothesis warmer(const std::string& subject, const Eigen::VectorXd& inflow) {
  NetworkHypothesis wrong;
  wrong.hypothesis.subject = subject;
  wrong.hypothesis.form = Form::shared_gain;
  wrong.hypothesis.gains = {std::string(offset.name)};
  wrong.hypothesis.bounds = [](std::size_t) { return Interval{offset.low, offset.high}; };
  // Warmer air adds a constant heat flow.
  wrong.apply = [inflow](HeatNetwork& network, const Shape&, double gain) {
    network.sources.push_back({"", gain, 1.0, 1.0, inflow});
  };
  return wrong;
}

std::vector<NetworkHypothesis> wrong_ambient_in_network(const NetworkMaterial& material,
                                                        const NetworkSubject& subject) {
  if (subject.kind == NetworkSubjectKind::room)
    return {warmer("room", material.plant.network.room_inflow)};
  if (subject.kind != NetworkSubjectKind::air_of_part) return {};
  const NetworkPart& part = material.plant.parts[subject.index];
  return {warmer(part.subject, part.inflow)};
}

/// The air around the machine, or around one part of it, differs from the room's reading.
Cause wrong_ambient() {
  Cause cause{"wrong_ambient", "structure"};
  cause.parameters = {offset};
  cause.texts = {
      "The air here is not the room's",
      "the air around this is warmer or colder than the reading of the room",
      "Move the room's sensor to the air that the machine is in, or take the offset into account."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = wrong_ambient_in_network;
  return cause;
}

}  // namespace

std::vector<Cause> of_network() {
  return {wrong_heat_source(), wrong_film_coefficient(), wrong_conductance(), wrong_heat_capacity(),
          wrong_ambient()};
}

}  // namespace thermocomp::diagnosis::causes
