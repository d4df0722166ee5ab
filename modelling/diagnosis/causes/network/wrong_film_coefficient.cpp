#include "modelling/diagnosis/causes/network/wrong_part.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "wrong_film_coefficient";

std::vector<NetworkHypothesis> in_network(const NetworkMaterial& material,
                                          const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::part) return {};
  const PartKind kind = material.plant.parts[subject.index].kind;
  if (kind != PartKind::room_film && kind != PartKind::coolant_film) return {};
  return of_wrong_part(material, subject, name);
}

bool into_machine(MachineFile& machine, const std::string& subject,
                  const std::vector<Parameter>& parameters) {
  const TwoNames film = two_names(subject);
  return machine.multiply_in_node(film.first,
                                  film.second == "room" ? "room_W_per_K" : "coolant_W_per_K",
                                  shared_value(parameters, "factor"));
}

}  // namespace

/// The film to the air or to the coolant has another conductance.
Cause wrong_film_coefficient() {
  Cause cause{name, "structure"};
  cause.parameters = {
      factor_of_part,
      {.name = "room_W_per_K", .unit = "W/K", .low = 0.0, .says = "to the air"},
      {.name = "coolant_W_per_K", .unit = "W/K", .low = 0.0, .says = "to the coolant"},
  };
  cause.texts = {
      "Air or coolant takes another heat",
      "this place gives another heat to the air or the coolant than the thermal model says",
      "Put the new value into the thermal model; look for a cover, a fan or a blocked jacket."};
  cause.experiment = Experiment::of_a_network;
  cause.in_network = in_network;
  cause.into_machine = into_machine;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
