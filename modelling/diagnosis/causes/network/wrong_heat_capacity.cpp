#include "modelling/diagnosis/causes/network/wrong_part.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "wrong_heat_capacity";

std::vector<NetworkHypothesis> in_network(const NetworkMaterial& material,
                                          const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::part) return {};
  const PartKind kind = material.plant.parts[subject.index].kind;
  if (kind != PartKind::capacity) return {};
  return of_wrong_part(material, subject, name);
}

bool into_machine(MachineFile& machine, const std::string& subject,
                  const std::vector<Parameter>& parameters) {
  return machine.multiply_in_node(two_names(subject).first, "capacity_J_per_K",
                                  shared_value(parameters, "factor"));
}

}  // namespace

/// A place has another heat capacity.
Cause wrong_heat_capacity() {
  Cause cause{name, "structure"};
  cause.parameters = {
      factor_of_part,
      {.name = "capacity_J_per_K", .unit = "J/K", .low = 0.0, .says = "stores"},
  };
  cause.texts = {
      "A place stores another heat", "this place stores another heat than the thermal model says",
      "Put the new value into the thermal model; look whether a mass was left out of it."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = in_network;
  cause.into_machine = into_machine;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
