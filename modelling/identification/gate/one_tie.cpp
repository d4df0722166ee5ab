#include "modelling/identification/gate/one_tie.hpp"

#include <cmath>

#include "estimator/checks.hpp"
#include "modelling/identification/printed.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::identification {
namespace {

constexpr double lowest_tie = 0.2;  // of the working height
constexpr double highest_tie = 3.0;
constexpr int steps = 2800;
constexpr double um_per_mm = 1000.0;

/// One curve per beta; `value` is evaluated with the tie at l / a.
template <class Value>
Drawing curves_over_a(const TiedColumns& columns, const std::string& title, const std::string& unit,
                      Value value) {
  const double own_beta =
      stiffness_ratio(columns) *
      std::pow(columns.ties.front().height_mm / columns.working_height_mm, 3);  // km/kc = beta a^3
  std::vector<double> ratios;
  for (double a = 1.0 / highest_tie; a <= 1.0 / lowest_tie; a += 0.01) ratios.push_back(a);
  const std::vector betas{own_beta, 0.01, 0.1, 0.5, 1.0};
  const std::vector colours{"#000000", "#1b6ca8", "#c8502c", "#3a8a3a", "#7b4fa0"};
  std::vector<std::vector<double>> values(betas.size());
  PlotPanel panel{title, unit, {}, 250.0};
  for (std::size_t i = 0; i < betas.size(); ++i) {
    TiedColumns other = columns;
    Tie& tie = other.ties.front();
    tie.area_mm2 *= own_beta / betas[i];
    for (const double a : ratios) {
      tie.height_mm = columns.working_height_mm / a;
      values[i].push_back(value(tied_coefficients(other)));
    }
    const bool own = i == 0;
    panel.lines.push_back({printed(own ? "this machine, beta %.3g" : "beta %.2g", betas[i]),
                           colours[i], values[i], false, own ? 0U : 1U});
  }
  return curves_drawing(ratios, "l / l4", {panel});
}

}  // namespace

double stiffness_ratio(const TiedColumns& columns) {
  THERMOCOMP_ENSURE(columns.ties.size() == 1);
  const Tie& tie = columns.ties.front();
  const double column =
      3.0 * columns.column_modulus_MPa * columns.column_inertia_mm4 / std::pow(tie.height_mm, 3);
  return column / (tie.area_mm2 * tie.modulus_MPa / tie.length_mm);
}

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
  TiedColumns free = columns;
  free.ties.clear();
  const double free_um_per_K = tied_coefficients(free).ki_um_per_K;
  const Tie& tie = columns.ties.front();
  const double tie_um_per_K = um_per_mm * tie.expansion_per_K * tie.length_mm;
  return svg_file(
      {curves_over_a(columns, "Ki relative to the column without a tie", "Ki / Ki0",
                     [&](const TiedCoefficients& k) { return k.ki_um_per_K / free_um_per_K; }),
       curves_over_a(
           columns, "Kc relative to the expansion of the tie", "Kc / (alpha lc)",
           [&](const TiedCoefficients& k) { return k.kc_um_per_K.front() / tie_um_per_K; })});
}

}  // namespace thermocomp::identification
