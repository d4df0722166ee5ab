#include "gate_fe.hpp"

#include <cmath>

#include <catch2/catch.hpp>

namespace thermocomp {
namespace {

identification::GateMachine slender() {
  identification::GateMachine m;
  m.working_height_mm = 600;
  m.heated_height_mm = 300;
  m.tie_height_mm = 400;
  m.column_width_mm = 80;
  m.tie_length_mm = 400;
  m.column_inertia_mm4 = 60.0 * 80 * 80 * 80 / 12;
  m.column_modulus_MPa = m.tie_modulus_MPa = 206000;
  m.column_expansion_per_K = m.tie_expansion_per_K = 11.5e-6;
  m.tie_area_mm2 = 150;
  return m;
}

TEST_CASE("beam formulas are what finite elements of a slender gate say", "[tiebar][fe]") {
  identification::GateMachine m = slender();
  m.tie_height_mm = GENERATE(250.0, 400.0, 600.0, 900.0);
  const auto beam = identification::tie_coefficients(m);
  const auto fe = bench::GateFe(m, 60.0).coefficients();
  const double free_um_per_K = 1000 * 3 * 11.5e-6 * 600 * 600 / (8 * 80);
  CHECK(std::abs(fe.ki_um_per_K - beam.ki_um_per_K) < 0.02 * free_um_per_K);
  CHECK(fe.kc_um_per_K == Approx(beam.kc_um_per_K).epsilon(0.04));
}

TEST_CASE("warm oil first brings tool and work closer, then the tie parts them", "[tiebar][fe]") {
  bench::GateFe gate(slender(), 60.0);
  double early_um = 0.0;
  for (int step = 0; step < 360; ++step) {
    gate.advance({40.0, 300.0}, 10.0);
    if (step == 12) early_um = gate.displacement_um();
  }
  CHECK(early_um > 3.0);
  CHECK(gate.displacement_um() < early_um);
  CHECK(gate.theta_a_K() > gate.theta_b_K());
  CHECK(gate.theta_c_K() > 0.0);
}

}  // namespace
}  // namespace thermocomp
