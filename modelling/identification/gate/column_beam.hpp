/// Cantilever column with shear (Timoshenko beam) whose foot may hold its section crosswise, and
/// the compliance of a tie bonded to it.
#pragma once

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

}  // namespace thermocomp::identification
