/// Coefficients of two columns joined by any number of ties, from dimensions and material: delta =
/// Ki (theta_A - theta_B) - sum_j Kc_j theta_Cj (beams by Castigliano, as in Teratani et al. 1995
/// for one tie; its third conclusion is a second tie above the working point).
#pragma once

#include <vector>

#include "modelling/identification/gate/column_beam.hpp"

namespace thermocomp::identification {

struct Tie {
  double height_mm{0.0};
  double length_mm{0.0};
  double area_mm2{0.0};
  double modulus_MPa{0.0};
  double expansion_per_K{0.0};
  /// Upward size of the section; its depth is area / thickness. Above 0 the tie is bonded to the
  /// inner faces of the columns; 0: pinned to their axes.
  double thickness_mm{0.0};
};

/// Equal columns, one of them heated on its outer side up to `heated_height_mm`.
struct TiedColumns {
  double working_height_mm{0.0};
  double heated_height_mm{0.0};
  double column_width_mm{0.0};
  double column_inertia_mm4{0.0};
  double column_modulus_MPa{0.0};
  double column_expansion_per_K{0.0};
  std::vector<Tie> ties;  ///< may be empty; ties at one height share the load
  /// Elasticity; all 0: as in the publication.
  double column_poisson_ratio{0.0};
  double column_shear_compliance_per_N{0.0};  ///< 1 / (G As), rectangle_shear_area_mm2()
  double foot_length_mm{0.0};                 ///< held_foot_length_mm(); 0: free crosswise
};

struct TiedCoefficients {
  double ki_um_per_K{0.0};
  std::vector<double> kc_um_per_K;  ///< one per tie
};

/// Only the displacement of two columns that bend as mirror images matters: the ties then carry a
/// force X_j and a moment M_j at both ends, but no shear. With the deflections of a cantilever
/// (column_beam.hpp), f per force and r per moment, and the tilt t:
///   at each tie:  sum_m [2 f(z_j,z_m) X_m + 2 r(z_j,z_m) M_m] + (lc_j/(Ac_j Ec_j) + 2 c_j) X_j
///                   = w(z_j) dAB + alpha_cj lc_j theta_Cj
///                 sum_m [2 r(z_m,z_j) X_m + 2 t(z_j,z_m) M_m] + lc_j/(Ec_j Ic_j) M_j = t(z_j) dAB
///   at the work:  delta = w(l) dAB - sum_m [2 f(l,z_m) X_m + 2 r(l,z_m) M_m]
/// A pinned tie (thickness 0) has no M_j and no c_j. One pinned tie at l4, columns rigid in shear
/// and feet free crosswise give the publication's cases, with l4^3 in the last one (printed: l4^2),
/// q = km/kc + 2, 1/kc = lc/(Ac Ec), 1/km = l4^3/(3 E I):
///   l4 <= l1       Ki = alpha/(2h) { l1 (2l - l1) - l4 (3l - l4) / q }
///   l1 <= l4 <= l  Ki = alpha/(2h) { l1 (2l - l1) - l1 (3l - l4)(2 l4 - l1) / (l4 q) }
///   l4 >= l        Ki = alpha/(2h) { l1 (2l - l1) - l^2 l1 (3 l4 - l)(2 l4 - l1) / (l4^3 q) }
///   l4 <= l        Kc = (3l - l4) lc alpha_c / (l4 q);  else l^2 (3 l4 - l) lc alpha_c / (l4^3 q)
///
/// A bonded tie ends at the face of the column, not at its axis: the end sinks in by c_j
/// (bonded_end_compliance_mm_per_N()), and bending and the gradient change the width of the section
/// (Timoshenko and Goodier, Theory of Elasticity, pure bending; Boley and Weiner, Theory of Thermal
/// Stresses, free plate), which moves the face towards the other column by
///   h^2/8 (nu M/(EI) - alpha/h dAB in the heated zone).
/// @pre all dimensions are positive
[[nodiscard]] TiedCoefficients tied_coefficients(const TiedColumns& columns);

}  // namespace thermocomp::identification
