#include <cmath>

#include <catch2/catch.hpp>

#include "modelling/identification/gate/tied_columns.hpp"

namespace thermocomp::identification {
namespace {

constexpr double width_mm = 80.0;
constexpr double depth_mm = 60.0;
constexpr double modulus_MPa = 206000.0;
constexpr double nu = 0.3;

ColumnBeam column() {
  ColumnBeam beam;
  beam.bending_stiffness_Nmm2 = modulus_MPa * depth_mm * std::pow(width_mm, 3) / 12;
  beam.shear_compliance_per_N = 2 * (1 + nu) / (modulus_MPa * width_mm * depth_mm * 5 / 6);
  beam.poisson_ratio = nu;
  beam.foot_length_mm = held_foot_length_mm(width_mm, depth_mm, nu);
  beam.curvature_per_mm_K = 11.5e-6 / width_mm;
  beam.heated_height_mm = 300;
  return beam;
}

TEST_CASE("deflections of a column are reciprocal", "[tiebar]") {
  const ColumnBeam beam = column();
  CHECK(beam.deflection_mm_per_N(250, 600) == Approx(beam.deflection_mm_per_N(600, 250)));
  CHECK(beam.tilt_per_Nmm(250, 600) == Approx(beam.tilt_per_Nmm(600, 250)));
}

TEST_CASE("a column's tilt is the slope of its deflection", "[tiebar]") {
  const ColumnBeam beam = column();
  constexpr double step_mm = 1e-3;
  for (const double height_mm : {100.0, 299.0, 450.0}) {
    CAPTURE(height_mm);
    const double warm = beam.thermal_deflection_mm_per_K(height_mm + step_mm) -
                        beam.thermal_deflection_mm_per_K(height_mm - step_mm);
    CHECK(warm / (2 * step_mm) == Approx(beam.thermal_tilt_per_K(height_mm)));
    const double bent = beam.deflection_per_N(height_mm + step_mm, 400) -
                        beam.deflection_per_N(height_mm - step_mm, 400);
    CHECK(bent / (2 * step_mm) == Approx(beam.tilt_per_Nmm(height_mm, 400)));
  }
}

TEST_CASE("shear deflects a slender column little and a stout one much", "[tiebar]") {
  ColumnBeam rigid = column();
  rigid.shear_compliance_per_N = 0;
  rigid.foot_length_mm = 0;
  ColumnBeam beam = rigid;
  beam.shear_compliance_per_N = column().shear_compliance_per_N;
  // Timoshenko: 1 + 3 EI / (G As z^2).
  for (const double height_mm : {100.0, 1000.0})
    CHECK(beam.deflection_mm_per_N(height_mm, height_mm) ==
          Approx(rigid.deflection_mm_per_N(height_mm, height_mm) *
                 (1 + 3 * beam.bending_stiffness_Nmm2 * beam.shear_compliance_per_N /
                          (height_mm * height_mm))));
}

TEST_CASE("a foot held crosswise tilts a heated column more and a loaded one less", "[tiebar]") {
  const ColumnBeam held = column();
  ColumnBeam free = held;
  free.foot_length_mm = 0;
  CHECK(held.thermal_deflection_mm_per_K(600) > free.thermal_deflection_mm_per_K(600));
  CHECK(held.deflection_mm_per_N(600, 600) < free.deflection_mm_per_N(600, 600));
  CHECK(held_foot_length_mm(width_mm, depth_mm, 0.0) == 0.0);
}

TEST_CASE("shear area: five sixths of a solid section, less of a box", "[tiebar]") {
  CHECK(rectangle_shear_area_mm2(80, 60, 80) == Approx(4000));
  CHECK(rectangle_shear_area_mm2(80, 60, 30) == Approx(4000));
  // Cowper 1966, thin square tube, nu = 0: 20/48 of the walls.
  CHECK(rectangle_shear_area_mm2(100, 100, 0.01) == Approx(20.0 / 48.0 * 4.0).epsilon(1e-3));
  CHECK(rectangle_shear_area_mm2(100, 1, 0.01) == Approx(5.0 / 6.0 * 2.0).epsilon(0.02));
}

TEST_CASE("a tie's end sinks in by the mean displacement under uniform pressure", "[tiebar]") {
  // Deep columns: the table of Timoshenko and Goodier, m (1 - nu^2) / (E sqrt(A)).
  const auto factor = [](double a_mm, double b_mm) {
    return bonded_end_compliance_mm_per_N(a_mm, b_mm, 1e9, modulus_MPa, nu) * modulus_MPa *
           std::sqrt(a_mm * b_mm) / (1 - nu * nu);
  };
  CHECK(factor(12, 12) == Approx(0.95).margin(0.005));
  CHECK(factor(10, 20) == Approx(0.92).margin(0.005));
  CHECK(factor(10, 50) == Approx(0.82).margin(0.005));
  CHECK(factor(1, 100) == Approx(0.37).margin(0.005));
  SECTION("less where the axis of the column is near, and never less than nothing") {
    CHECK(bonded_end_compliance_mm_per_N(12, 12, 80, modulus_MPa, nu) <
          bonded_end_compliance_mm_per_N(12, 12, 200, modulus_MPa, nu));
    CHECK(bonded_end_compliance_mm_per_N(200, 60, 80, modulus_MPa, nu) == 0.0);
  }
}

}  // namespace
}  // namespace thermocomp::identification
