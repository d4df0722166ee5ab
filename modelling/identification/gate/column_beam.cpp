#include "modelling/identification/gate/column_beam.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

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

}  // namespace thermocomp::identification
