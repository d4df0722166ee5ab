/// Coefficients of two columns joined by any number of ties, from dimensions and material: delta =
/// Ki (theta_A - theta_B) - sum_j Kc_j theta_Cj (beams by Castigliano, as in Teratani et al. 1995
/// for one tie; its third conclusion is a second tie above the working point). Each column is a
/// cantilever with shear (Timoshenko beam) whose foot may hold its section crosswise. Of a single
/// tie also its best height and design curves.
#pragma once

#include <string>
#include <vector>

namespace thermocomp::identification {

struct ColumnBeam {
  double bending_stiffness_Nmm2{0.0};  ///< EI
  double shear_compliance_per_N{0.0};  ///< 1 / (G As)
  double poisson_ratio{0.0};           ///< nu
  double foot_length_mm{0.0};          ///< s
  double curvature_per_mm_K{0.0};      ///< alpha / h, per kelvin between the sides
  double heated_height_mm{0.0};        ///< l1

  /// Deflection per kelvin: w(z) = alpha/(2h) z^2 up to l1, alpha/(2h) l1 (2z - l1) above, +
  /// alpha/h s z [mm/K].
  [[nodiscard]] double thermal_deflection_mm_per_K(double height_mm) const;
  /// Tilt per kelvin: t(z) = alpha/h (min(z, l1) + s) [1/K].
  [[nodiscard]] double thermal_tilt_per_K(double height_mm) const;
  /// Deflection at z per force at a: f(z,a) = m^2 (3M - m)/(6EI) + m/(G As) - nu s z a/(EI), m, M:
  /// the lesser and the greater of z and a [mm/N].
  [[nodiscard]] double deflection_mm_per_N(double height_mm, double force_at_mm) const;
  /// Deflection at z per moment at a, equal to the tilt at a per force at z: r(z,a) = m (2z -
  /// m)/(2EI) - nu s z/(EI), m: the lesser of z and a [mm/(N mm)].
  [[nodiscard]] double deflection_per_N(double height_mm, double moment_at_mm) const;
  /// Tilt at z per moment at a: t(z,a) = min(z, a)/(EI) - nu s/(EI) [1/(N mm)].
  [[nodiscard]] double tilt_per_Nmm(double height_mm, double moment_at_mm) const;
};

/// Shear area of a rectangle, or of a box with walls of equal thickness, from the strain energy of
/// the shear stresses of bending (Castigliano) [mm^2]: 5/6 of a solid section; of a box I^2 /
/// integral (S^2/t) ds along its walls, S: first moment between there and the middle of the flange.
/// Thin walls give the box of Cowper 1966 at nu = 0.
/// @param wall_mm  at least half of the lesser side: solid
[[nodiscard]] double rectangle_shear_area_mm2(double width_mm, double depth_mm, double wall_mm);

/// Length by which a foot held crosswise extends the heated zone of a solid column.
///
/// A section that cannot widen bends more under a temperature gradient: the foot tilts the column
/// by alpha/h s per kelvin. Under a bending moment the foot restrains the same displacement
/// pattern, nu/(EI) times as large, and reduces the tilt by nu s/(EI) per moment.
///   s = h nu (1 + 0.73 nu^2)(0.064 + 0.149 d/h + 0.023 (d/h)^2),
/// fitted within 5 % to finite elements of clamped columns (gate_structure_test '[foot]').
/// @param poisson_ratio  up to 0.4 @param depth_mm  d, from 0.1 to 2 h
[[nodiscard]] double held_foot_length_mm(double width_mm, double depth_mm, double poisson_ratio);

/// Compliance of a tie's end in the face of a column, relative to the column's axis [mm/N]: mean
/// displacement of a half-space under uniform pressure on a rectangle a x b,
///   (1 - nu^2)/E 2/(pi a b) [a asinh(b/a) + b asinh(a/b) + (a^3 + b^3 - (a^2 + b^2)^1.5)/(3ab)]
/// (Timoshenko and Goodier, Theory of Elasticity, pressure on part of the boundary), minus
/// Boussinesq's displacement at the depth of the axis, (1 + nu)(3 - 2nu)/(pi E h); not below 0.
[[nodiscard]] double bonded_end_compliance_mm_per_N(double thickness_mm, double depth_mm,
                                                    double column_width_mm, double modulus_MPa,
                                                    double poisson_ratio);

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
/// (ColumnBeam), f per force and r per moment, and the tilt t:
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

/// km / kc: stiffness of a column at the tie, divided by that of the tie.
/// @pre there is one tie
[[nodiscard]] double stiffness_ratio(const TiedColumns& columns);

/// Tie height from 0.2 l to 3 l with the smallest |Ki - Kc ratio|, ratio = theta_C / (theta_A -
/// theta_B).
struct BestHeight {
  double tie_height_mm{0.0};
  double displacement_um_per_K{0.0};  ///< Ki - Kc ratio there
};
/// @pre there is one tie
[[nodiscard]] BestHeight best_tie_height(const TiedColumns& columns, double ratio);

/// Ki and Kc over l / l4, relative to the published Ki without a tie and to alpha_c lc, for this
/// machine and for other tie stiffnesses (beta = 3 I lc / (Ac l^3) at one material).
/// @pre there is one tie
[[nodiscard]] std::string design_curves_svg(const TiedColumns& columns);

}  // namespace thermocomp::identification
