#include "modelling/identification/gate/tied_columns.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "estimator/checks.hpp"
#include "modelling/identification/printed.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::identification {

double ColumnBeam::thermal_deflection_mm_per_K(double height_mm) const {
  const double l1 = heated_height_mm;
  const double shape_mm2 = height_mm <= l1 ? height_mm * height_mm : l1 * (2.0 * height_mm - l1);
  return curvature_per_mm_K * (shape_mm2 / 2.0 + foot_length_mm * height_mm);
}

double ColumnBeam::thermal_tilt_per_K(double height_mm) const {
  return curvature_per_mm_K * (std::min(height_mm, heated_height_mm) + foot_length_mm);
}

double ColumnBeam::deflection_mm_per_N(double height_mm, double force_at_mm) const {
  const double low = std::min(height_mm, force_at_mm);
  const double high = std::max(height_mm, force_at_mm);
  const double held_mm3 = poisson_ratio * foot_length_mm * low * high;
  return (low * low * (3.0 * high - low) / 6.0 - held_mm3) / bending_stiffness_Nmm2 +
         low * shear_compliance_per_N;
}

double ColumnBeam::deflection_per_N(double height_mm, double moment_at_mm) const {
  const double low = std::min(height_mm, moment_at_mm);
  const double held_mm2 = poisson_ratio * foot_length_mm * height_mm;
  return (low * (2.0 * height_mm - low) / 2.0 - held_mm2) / bending_stiffness_Nmm2;
}

double ColumnBeam::tilt_per_Nmm(double height_mm, double moment_at_mm) const {
  return (std::min(height_mm, moment_at_mm) - poisson_ratio * foot_length_mm) /
         bending_stiffness_Nmm2;
}

double rectangle_shear_area_mm2(double width_mm, double depth_mm, double wall_mm) {
  if (2.0 * wall_mm >= std::min(width_mm, depth_mm)) return 5.0 / 6.0 * width_mm * depth_mm;
  const double h = width_mm - wall_mm;  // between the middles of the walls
  const double b = depth_mm - wall_mm;
  const double inertia_per_wall_mm3 = h * h * h / 6.0 + b * h * h / 2.0;
  const double flow_per_wall_mm5 =
      h * h * (b * b * b / 24.0 + h * b * b / 8.0 + h * h * b / 12.0 + h * h * h / 60.0);
  return wall_mm * inertia_per_wall_mm3 * inertia_per_wall_mm3 / flow_per_wall_mm5;
}

double held_foot_length_mm(double width_mm, double depth_mm, double poisson_ratio) {
  const double slender = depth_mm / width_mm;
  return width_mm * poisson_ratio * (1.0 + 0.73 * poisson_ratio * poisson_ratio) *
         (0.064 + 0.149 * slender + 0.023 * slender * slender);
}

double bonded_end_compliance_mm_per_N(double thickness_mm, double depth_mm, double column_width_mm,
                                      double modulus_MPa, double poisson_ratio) {
  const double a = thickness_mm;
  const double b = depth_mm;
  const double shape_mm =
      a * std::asinh(b / a) + b * std::asinh(a / b) +
      (std::pow(a, 3) + std::pow(b, 3) - std::pow(std::hypot(a, b), 3)) / (3.0 * a * b);
  const double face = (1.0 - poisson_ratio * poisson_ratio) * 2.0 * shape_mm / (a * b);
  const double axis = (1.0 + poisson_ratio) * (3.0 - 2.0 * poisson_ratio) / column_width_mm;
  return std::max(0.0, face - axis) / (std::numbers::pi * modulus_MPa);
}

namespace {

constexpr double um_per_mm = 1000.0;

ColumnBeam beam_of(const TiedColumns& columns) {
  return {columns.column_modulus_MPa * columns.column_inertia_mm4,
          columns.column_shear_compliance_per_N,
          columns.column_poisson_ratio,
          columns.foot_length_mm,
          columns.column_expansion_per_K / columns.column_width_mm,
          columns.heated_height_mm};
}

/// A tie on a column, with the difference between the column's face and axis.
class TiedPlace {
 public:
  TiedPlace(const TiedColumns& columns, const Tie& tie)
      : tie_(tie), beam_(beam_of(columns)), width_mm_(columns.column_width_mm) {}

  [[nodiscard]] bool bonded() const { return tie_.thickness_mm > 0.0; }
  /// h^2/8, displacement of the column's face per curvature; 0 for a tie on the axis.
  [[nodiscard]] double face_mm2() const { return bonded() ? width_mm_ * width_mm_ / 8.0 : 0.0; }

  [[nodiscard]] double thermal_deflection_mm_per_K() const {
    const double heated =
        bonded() ? std::clamp((beam_.heated_height_mm - tie_.height_mm) / tie_.thickness_mm + 0.5,
                              0.0, 1.0)
                 : 0.0;
    return beam_.thermal_deflection_mm_per_K(tie_.height_mm) -
           beam_.curvature_per_mm_K * face_mm2() * heated;
  }
  /// Deflection here per force on the axis of the column.
  [[nodiscard]] double deflection_mm_per_N(double force_at_mm) const {
    return beam_.deflection_mm_per_N(tie_.height_mm, force_at_mm) +
           widening_per_Nmm() * std::max(0.0, force_at_mm - tie_.height_mm);
  }
  /// Deflection here per force of another tie.
  [[nodiscard]] double deflection_mm_per_N(const TiedPlace& other) const {
    return deflection_mm_per_N(other.tie_.height_mm) +
           other.widening_per_Nmm() * std::max(0.0, tie_.height_mm - other.tie_.height_mm);
  }
  /// Deflection here per moment of another tie.
  [[nodiscard]] double deflection_per_N(const TiedPlace& other) const {
    const bool below = tie_.height_mm < other.tie_.height_mm;
    return beam_.deflection_per_N(tie_.height_mm, other.tie_.height_mm) +
           (below ? widening_per_Nmm() : 0.0);
  }
  [[nodiscard]] double tilt_per_Nmm(const TiedPlace& other) const {
    return beam_.tilt_per_Nmm(tie_.height_mm, other.tie_.height_mm);
  }
  [[nodiscard]] double thermal_tilt_per_K() const {
    return beam_.thermal_tilt_per_K(tie_.height_mm);
  }

  /// Compliance of the tie and its bonded ends.
  [[nodiscard]] double own_mm_per_N(const TiedColumns& columns) const {
    const double bar = tie_.length_mm / (tie_.area_mm2 * tie_.modulus_MPa);
    if (!bonded()) return bar;
    return bar + 2.0 * bonded_end_compliance_mm_per_N(
                           tie_.thickness_mm, tie_.area_mm2 / tie_.thickness_mm, width_mm_,
                           columns.column_modulus_MPa, columns.column_poisson_ratio);
  }
  [[nodiscard]] double own_tilt_per_Nmm() const {
    const double inertia_mm4 = tie_.area_mm2 * tie_.thickness_mm * tie_.thickness_mm / 12.0;
    return tie_.length_mm / (tie_.modulus_MPa * inertia_mm4);
  }

 private:
  [[nodiscard]] double widening_per_Nmm() const {
    return beam_.poisson_ratio * face_mm2() / beam_.bending_stiffness_Nmm2;
  }

  const Tie& tie_;
  ColumnBeam beam_;
  double width_mm_;
};

/// Unknowns: forces of all ties, then moments of the bonded ones.
struct TieEquations {
  Eigen::MatrixXd yielding;  ///< compliance of both columns and of the ties
  Eigen::VectorXd bent;      ///< per kelvin of A - B
  Eigen::VectorXd at_work;   ///< approach of tool and work per unit of each
};

TieEquations equations_of(const TiedColumns& columns) {
  std::vector<TiedPlace> places;
  for (const Tie& tie : columns.ties) places.emplace_back(columns, tie);
  std::vector<std::size_t> bonded;
  for (std::size_t j = 0; j < places.size(); ++j)
    if (places[j].bonded()) bonded.push_back(j);
  const auto forces = static_cast<Eigen::Index>(places.size());
  const auto size = forces + static_cast<Eigen::Index>(bonded.size());
  TieEquations equations{Eigen::MatrixXd(size, size), Eigen::VectorXd(size), Eigen::VectorXd(size)};
  const double work_mm = columns.working_height_mm;
  const ColumnBeam beam = beam_of(columns);
  for (Eigen::Index j = 0; j < forces; ++j) {
    const TiedPlace& place = places[static_cast<std::size_t>(j)];
    for (Eigen::Index m = 0; m < forces; ++m)
      equations.yielding(j, m) =
          2.0 * place.deflection_mm_per_N(places[static_cast<std::size_t>(m)]);
    equations.yielding(j, j) += place.own_mm_per_N(columns);
    equations.bent[j] = place.thermal_deflection_mm_per_K();
    equations.at_work[j] = 2.0 * place.deflection_mm_per_N(work_mm);
  }
  for (Eigen::Index i = forces; i < size; ++i) {
    const std::size_t tie = bonded[static_cast<std::size_t>(i - forces)];
    const TiedPlace& place = places[tie];
    for (Eigen::Index j = 0; j < forces; ++j)
      equations.yielding(j, i) = equations.yielding(i, j) =
          2.0 * places[static_cast<std::size_t>(j)].deflection_per_N(place);
    for (Eigen::Index m = forces; m < size; ++m)
      equations.yielding(i, m) =
          2.0 * place.tilt_per_Nmm(places[bonded[static_cast<std::size_t>(m - forces)]]);
    equations.yielding(i, i) += place.own_tilt_per_Nmm();
    equations.bent[i] = place.thermal_tilt_per_K();
    equations.at_work[i] = 2.0 * beam.deflection_per_N(work_mm, columns.ties[tie].height_mm);
  }
  return equations;
}

}  // namespace

TiedCoefficients tied_coefficients(const TiedColumns& columns) {
  const double free_um_per_K =
      um_per_mm * beam_of(columns).thermal_deflection_mm_per_K(columns.working_height_mm);
  if (columns.ties.empty()) return {free_um_per_K, {}};
  const TieEquations equations = equations_of(columns);
  // Separation of tool and work per mm of excess length of a tie: the matrix is symmetric, so one
  // solution serves every right side.
  const Eigen::VectorXd parted = equations.yielding.llt().solve(equations.at_work);
  TiedCoefficients k{free_um_per_K - um_per_mm * parted.dot(equations.bent), {}};
  for (std::size_t j = 0; j < columns.ties.size(); ++j) {
    const Tie& tie = columns.ties[j];
    k.kc_um_per_K.push_back(um_per_mm * parted[static_cast<Eigen::Index>(j)] * tie.length_mm *
                            tie.expansion_per_K);
  }
  return k;
}

namespace {

constexpr double lowest_tie = 0.2;  // of the working height
constexpr double highest_tie = 3.0;
constexpr int steps = 2800;

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
