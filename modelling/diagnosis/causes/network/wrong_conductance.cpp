#include "modelling/diagnosis/causes/network/wrong_part.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "wrong_conductance";

std::vector<NetworkHypothesis> in_network(const NetworkMaterial& material,
                                          const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::part) return {};
  const PartKind kind = material.plant.parts[subject.index].kind;
  if (kind != PartKind::joint) return {};
  return of_wrong_part(material, subject, name);
}

bool into_machine(MachineFile& machine, const std::string& subject,
                  const std::vector<Parameter>& parameters) {
  return machine.multiply_in_link(two_names(subject), "conductance_W_per_K",
                                  shared_value(parameters, "factor"));
}

}  // namespace

/// A joint of two places has another conductance.
Cause wrong_conductance() {
  Cause cause{name, "structure"};
  cause.parameters = {
      factor_of_part,
      {.name = "conductance_W_per_K", .unit = "W/K", .low = 0.0, .says = "conducts"},
  };
  cause.texts = {
      "A joint conducts otherwise", "this joint conducts otherwise than the thermal model says",
      "Put the new value into the thermal model; look at pressure and flatness of the joint."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = in_network;
  cause.into_machine = into_machine;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
