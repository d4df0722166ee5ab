/// Two columns and any number of ties between them: delta = Ki (theta_A - theta_B) - sum_j Kc_j
/// theta_Cj from dimensions and material (beams by Castigliano, as Teratani et al. 1995 has them
/// for one tie; its third conclusion is a second tie above the working point).
#pragma once

#include <vector>

#include "modelling/identification/gate/gate_machine.hpp"

namespace thermocomp::identification {

struct Tie {
  double height_mm{0.0};
  double length_mm{0.0};
  double area_mm2{0.0};
  double modulus_MPa{0.0};
  double expansion_per_K{0.0};
};

/// Equal columns, one of them heated on its outer side up to `heated_height_mm`.
struct TiedColumns {
  double working_height_mm{0.0};
  double heated_height_mm{0.0};
  double column_width_mm{0.0};
  double column_inertia_mm4{0.0};
  double column_modulus_MPa{0.0};
  double column_expansion_per_K{0.0};
  std::vector<Tie> ties;  ///< may be empty; several at one height share what they hold
};

struct TiedCoefficients {
  double ki_um_per_K{0.0};
  std::vector<double> kc_um_per_K;  ///< one a tie
};

/// Cantilevers of stiffness EI, pushed apart by X_j at the heights z_j of the ties:
///   bending of the heated one, at 1 K of A - B:  w(z) = alpha/(2h) z^2          z <= l1
///                                                     = alpha/(2h) l1 (2z - l1)  above
///   influence of a force at a:                   f(z,a) = m^2 (3M - m) / (6EI), m, M: the lesser
///                                                and the greater of z and a
///   at each tie:  sum_m 2 f(z_j,z_m) X_m + X_j lc_j/(Ac_j Ec_j) = w(z_j) dAB + alpha_cj lc_j
///   theta_Cj at the work:  delta = w(l) dAB - sum_m 2 f(l,z_m) X_m
/// With one tie these are the three cases of tie_coefficients().
/// @pre all dimensions are positive
[[nodiscard]] TiedCoefficients tied_coefficients(const TiedColumns& columns);

[[nodiscard]] TiedColumns columns_of(const GateMachine& machine);
/// @pre there is one tie
[[nodiscard]] GateMachine machine_of(const TiedColumns& columns);

}  // namespace thermocomp::identification
