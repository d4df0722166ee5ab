#include "modelling/identification/gate/one_tie.hpp"

#include <cmath>

#include "estimator/checks.hpp"
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
std::string curves_over_a(const TiedColumns& columns, const std::string& title,
                          const std::string& y_label, Value value) {
  const GateMachine machine = machine_of(columns);
  const double own_beta =
      stiffness_ratio(machine) *
      std::pow(machine.tie_height_mm / machine.working_height_mm, 3);  // km/kc = beta a^3
  Diagram diagram{title, "l / l4", y_label, {}, 720.0, 320.0};
  for (const double beta : {own_beta, 0.01, 0.1, 0.5, 1.0}) {
    const bool own = diagram.curves.empty();
    Curve curve{own ? printed("this machine, beta %.3g", beta) : printed("beta %.2g", beta),
                {},
                {},
                own ? "#000000" : "",
                !own};
    TiedColumns other = columns;
    Tie& tie = other.ties.front();
    tie.area_mm2 *= own_beta / beta;
    for (double a = 1.0 / highest_tie; a <= 1.0 / lowest_tie; a += 0.01) {
      tie.height_mm = columns.working_height_mm / a;
      curve.x.push_back(a);
      curve.y.push_back(value(tied_coefficients(other)));
    }
    diagram.curves.push_back(std::move(curve));
  }
  return svg_of(diagram);
}

}  // namespace

BestHeight best_tie_height(const TiedColumns& columns, double ratio) {
  BestHeight best{0.0, INFINITY};
  TiedColumns other = columns;
  THERMOCOMP_ENSURE(other.ties.size() == 1);
  Tie& tie = other.ties.front();
  for (int step = 0; step <= steps; ++step) {
    const double share = lowest_tie + (highest_tie - lowest_tie) * step / steps;
    tie.height_mm = share * columns.working_height_mm;
    const TiedCoefficients k = tied_coefficients(other);
    const double displacement = k.ki_um_per_K - k.kc_um_per_K.front() * ratio;
    if (std::abs(displacement) < std::abs(best.displacement_um_per_K))
      best = {tie.height_mm, displacement};
  }
  return best;
}

std::string design_curves_svg(const TiedColumns& columns) {
  const GateMachine machine = machine_of(columns);
  const double l = machine.working_height_mm;
  const double l1 = machine.heated_height_mm;
  const double free_um_per_K = um_per_mm * machine.column_expansion_per_K * l1 * (2.0 * l - l1) /
                               (2.0 * machine.column_width_mm);
  const double tie_um_per_K = um_per_mm * machine.tie_expansion_per_K * machine.tie_length_mm;
  std::string text(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"720\" height=\"650\">\n<g>\n");
  text += curves_over_a(columns, "Ki relative to the column without a tie", "Ki / Ki0",
                        [&](const TiedCoefficients& k) { return k.ki_um_per_K / free_um_per_K; });
  text += "</g>\n<g transform=\"translate(0 330)\">\n";
  text += curves_over_a(
      columns, "Kc relative to the expansion of the tie", "Kc / (alpha lc)",
      [&](const TiedCoefficients& k) { return k.kc_um_per_K.front() / tie_um_per_K; });
  return text.append("</g>\n</svg>\n");
}

}  // namespace thermocomp::identification
