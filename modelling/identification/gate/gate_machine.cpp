#include "modelling/identification/gate/gate_machine.hpp"

#include <cmath>

#include "modelling/identification/printed.hpp"
#include "modelling/identification/svg.hpp"

namespace thermocomp::identification {
namespace {

constexpr double lowest_tie = 0.2;  // of the working height
constexpr double highest_tie = 3.0;
constexpr int steps = 2800;
constexpr double um_per_mm = 1000.0;

/// One curve a beta; `value` of a machine with the tie at l / a.
template <class Value>
std::string curves_over_a(const GateMachine& machine, const std::string& title,
                          const std::string& y_label, Value value) {
  const auto beta_of = [](const GateMachine& each) {
    return stiffness_ratio(each) *
           std::pow(each.tie_height_mm / each.working_height_mm, 3);  // km/kc = beta a^3
  };
  const double own_beta = beta_of(machine);
  Diagram diagram{title, "l / l4", y_label, {}, 720.0, 320.0};
  for (const double beta : {own_beta, 0.01, 0.1, 0.5, 1.0}) {
    const bool own = diagram.curves.empty();
    Curve curve{own ? printed("this machine, beta %.3g", beta) : printed("beta %.2g", beta),
                {},
                {},
                own ? "#000000" : "",
                !own};
    GateMachine other = machine;
    other.tie_area_mm2 *= own_beta / beta;
    for (double a = 1.0 / highest_tie; a <= 1.0 / lowest_tie; a += 0.01) {
      other.tie_height_mm = machine.working_height_mm / a;
      curve.x.push_back(a);
      curve.y.push_back(value(tie_coefficients(other)));
    }
    diagram.curves.push_back(std::move(curve));
  }
  return svg_of(diagram);
}

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

BestHeight best_tie_height(const GateMachine& machine, double ratio) {
  BestHeight best{0.0, INFINITY};
  GateMachine other = machine;
  for (int step = 0; step <= steps; ++step) {
    const double share = lowest_tie + (highest_tie - lowest_tie) * step / steps;
    other.tie_height_mm = share * machine.working_height_mm;
    const TieCoefficients k = tie_coefficients(other);
    const double displacement = k.ki_um_per_K - k.kc_um_per_K * ratio;
    if (std::abs(displacement) < std::abs(best.displacement_um_per_K))
      best = {other.tie_height_mm, displacement};
  }
  return best;
}

std::string design_curves_svg(const GateMachine& machine) {
  const double l = machine.working_height_mm;
  const double l1 = machine.heated_height_mm;
  const double free_um_per_K = um_per_mm * machine.column_expansion_per_K * l1 * (2.0 * l - l1) /
                               (2.0 * machine.column_width_mm);
  const double tie_um_per_K = um_per_mm * machine.tie_expansion_per_K * machine.tie_length_mm;
  std::string text(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"720\" height=\"650\">\n<g>\n");
  text += curves_over_a(machine, "Ki relative to the column without a tie", "Ki / Ki0",
                        [&](const TieCoefficients& k) { return k.ki_um_per_K / free_um_per_K; });
  text += "</g>\n<g transform=\"translate(0 330)\">\n";
  text += curves_over_a(machine, "Kc relative to the expansion of the tie", "Kc / (alpha lc)",
                        [&](const TieCoefficients& k) { return k.kc_um_per_K / tie_um_per_K; });
  return text.append("</g>\n</svg>\n");
}

}  // namespace thermocomp::identification
