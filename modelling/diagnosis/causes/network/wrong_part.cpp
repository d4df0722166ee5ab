#include "modelling/diagnosis/causes/network/wrong_part.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

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

}  // namespace

std::vector<NetworkHypothesis> of_wrong_part(const NetworkMaterial& material,
                                             const NetworkSubject& subject, const char* cause) {
  const NetworkPart& part = material.plant.parts[subject.index];
  NetworkHypothesis wrong;
  wrong.hypothesis.cause = cause;
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

}  // namespace thermocomp::diagnosis::causes
