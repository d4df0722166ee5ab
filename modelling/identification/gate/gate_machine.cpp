#include "modelling/identification/gate/gate_machine.hpp"

#include <cmath>

namespace thermocomp::identification {
namespace {

constexpr double um_per_mm = 1000.0;

}  // namespace

double stiffness_ratio(const GateMachine& machine) {
  const double tie = machine.tie_area_mm2 * machine.tie_modulus_MPa / machine.tie_length_mm;
  const double column = 3.0 * machine.column_modulus_MPa * machine.column_inertia_mm4 /
                        std::pow(machine.tie_height_mm, 3);
  return column / tie;
}

TieCoefficients tie_coefficients(const GateMachine& machine) {
  const double l = machine.working_height_mm;
  const double l1 = machine.heated_height_mm;
  const double l4 = machine.tie_height_mm;
  const double q = stiffness_ratio(machine) + 2.0;
  double held = 0.0;  // what the tie takes back
  if (l4 <= l1)
    held = l4 * (3.0 * l - l4) / q;
  else if (l4 <= l)
    held = l1 * (3.0 * l - l4) * (2.0 * l4 - l1) / (l4 * q);
  else
    held = l * l * l1 * (3.0 * l4 - l) * (2.0 * l4 - l1) / (l4 * l4 * l4 * q);
  const double pushed =
      l4 <= l ? (3.0 * l - l4) / (l4 * q) : l * l * (3.0 * l4 - l) / (l4 * l4 * l4 * q);
  return {um_per_mm * machine.column_expansion_per_K / (2.0 * machine.column_width_mm) *
              (l1 * (2.0 * l - l1) - held),
          um_per_mm * pushed * machine.tie_length_mm * machine.tie_expansion_per_K};
}

}  // namespace thermocomp::identification
