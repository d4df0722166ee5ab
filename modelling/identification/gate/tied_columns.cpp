#include "modelling/identification/gate/tied_columns.hpp"

#include <algorithm>

#include <Eigen/Cholesky>

namespace thermocomp::identification {
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

}  // namespace thermocomp::identification
