#include "modelling/identification/gate/tied_columns.hpp"

#include <algorithm>

#include <Eigen/Cholesky>

#include "estimator/checks.hpp"

namespace thermocomp::identification {
namespace {

constexpr double um_per_mm = 1000.0;

/// How far the heated column bends towards the other, at 1 K across it [mm/K].
double bending_mm_per_K(const TiedColumns& columns, double height_mm) {
  const double l1 = columns.heated_height_mm;
  const double shape_mm2 = height_mm <= l1 ? height_mm * height_mm : l1 * (2.0 * height_mm - l1);
  return columns.column_expansion_per_K / (2.0 * columns.column_width_mm) * shape_mm2;
}

/// How far a column yields at one height to a force at another [mm/N].
double influence_mm_per_N(const TiedColumns& columns, double a_mm, double b_mm) {
  const double low = std::min(a_mm, b_mm);
  const double high = std::max(a_mm, b_mm);
  return low * low * (3.0 * high - low) /
         (6.0 * columns.column_modulus_MPa * columns.column_inertia_mm4);
}

}  // namespace

TiedCoefficients tied_coefficients(const TiedColumns& columns) {
  const auto count = static_cast<Eigen::Index>(columns.ties.size());
  const double free_um_per_K = um_per_mm * bending_mm_per_K(columns, columns.working_height_mm);
  if (count == 0) return {free_um_per_K, {}};
  Eigen::MatrixXd yielding(count, count);  // [mm/N]: both columns, and the ties in themselves
  Eigen::VectorXd bent(count);             // [mm/K]
  Eigen::VectorXd at_work(count);          // [mm/N]
  for (Eigen::Index j = 0; j < count; ++j) {
    const Tie& tie = columns.ties[static_cast<std::size_t>(j)];
    for (Eigen::Index m = 0; m < count; ++m)
      yielding(j, m) =
          2.0 * influence_mm_per_N(columns, tie.height_mm,
                                   columns.ties[static_cast<std::size_t>(m)].height_mm);
    yielding(j, j) += tie.length_mm / (tie.area_mm2 * tie.modulus_MPa);
    bent[j] = bending_mm_per_K(columns, tie.height_mm);
    at_work[j] = 2.0 * influence_mm_per_N(columns, columns.working_height_mm, tie.height_mm);
  }
  // How far tool and work part for each mm that a tie would be too long: symmetric, so one solution
  // serves every right side.
  const Eigen::VectorXd parted = yielding.llt().solve(at_work);
  TiedCoefficients k{free_um_per_K - um_per_mm * parted.dot(bent), {}};
  for (Eigen::Index j = 0; j < count; ++j) {
    const Tie& tie = columns.ties[static_cast<std::size_t>(j)];
    k.kc_um_per_K.push_back(um_per_mm * parted[j] * tie.length_mm * tie.expansion_per_K);
  }
  return k;
}

TiedColumns columns_of(const GateMachine& machine) {
  return {machine.working_height_mm,
          machine.heated_height_mm,
          machine.column_width_mm,
          machine.column_inertia_mm4,
          machine.column_modulus_MPa,
          machine.column_expansion_per_K,
          {{machine.tie_height_mm, machine.tie_length_mm, machine.tie_area_mm2,
            machine.tie_modulus_MPa, machine.tie_expansion_per_K}}};
}

GateMachine machine_of(const TiedColumns& columns) {
  THERMOCOMP_ENSURE(columns.ties.size() == 1);
  const Tie& tie = columns.ties.front();
  GateMachine machine;
  machine.working_height_mm = columns.working_height_mm;
  machine.heated_height_mm = columns.heated_height_mm;
  machine.tie_height_mm = tie.height_mm;
  machine.column_width_mm = columns.column_width_mm;
  machine.tie_length_mm = tie.length_mm;
  machine.column_inertia_mm4 = columns.column_inertia_mm4;
  machine.column_modulus_MPa = columns.column_modulus_MPa;
  machine.column_expansion_per_K = columns.column_expansion_per_K;
  machine.tie_area_mm2 = tie.area_mm2;
  machine.tie_modulus_MPa = tie.modulus_MPa;
  machine.tie_expansion_per_K = tie.expansion_per_K;
  return machine;
}

}  // namespace thermocomp::identification
