#include "modelling/identification/gate/gate_machine.hpp"

#include <cmath>

#include <catch2/catch.hpp>

#include "modelling/identification/gate/one_tie.hpp"

namespace thermocomp::identification {
namespace {

GateMachine machine(double a, double beta) {
  GateMachine m;
  m.working_height_mm = 600;
  m.heated_height_mm = 300;
  m.tie_height_mm = 600 / a;
  m.column_width_mm = 80;
  m.tie_length_mm = 400;
  m.column_inertia_mm4 = 60.0 * 80 * 80 * 80 / 12;
  m.column_modulus_MPa = m.tie_modulus_MPa = 206000;
  m.column_expansion_per_K = m.tie_expansion_per_K = 11.5e-6;
  m.tie_area_mm2 = 3.0 * m.column_inertia_mm4 * m.tie_length_mm / (beta * 600.0 * 600 * 600);
  return m;
}

TEST_CASE("Ki and Kc are the dimensionless forms in all three cases", "[tiebar]") {
  const double beta = GENERATE(0.01, 0.1, 1.0);
  for (double a = 0.4; a < 4.0; a += 0.05) {
    const double q = beta * a * a * a + 2;
    const double ki = a >= 2   ? 1 - 4 * (3 * a - 1) / (3 * a * a * q)
                      : a >= 1 ? 1 - (3 * a - 1) * (4 - a) / (3 * a * q)
                               : 1 - a * (3 - a) * (4 - a) / (3 * q);
    const double kc = a >= 1 ? (3 * a - 1) / q : a * a * (3 - a) / q;
    const TieCoefficients k = tie_coefficients(machine(a, beta));
    CAPTURE(a, beta);
    CHECK(k.ki_um_per_K / (1000 * 3 * 11.5e-6 * 600 * 600 / (8 * 80)) == Approx(ki).margin(1e-12));
    CHECK(k.kc_um_per_K / (1000 * 11.5e-6 * 400) == Approx(kc));
  }
}

TEST_CASE("the three cases meet where the tie is at the heated zone's end and at the work",
          "[tiebar]") {
  for (const double a : {1.0, 2.0}) {
    const TieCoefficients below = tie_coefficients(machine(a * (1 + 1e-9), 0.1));
    const TieCoefficients above = tie_coefficients(machine(a * (1 - 1e-9), 0.1));
    CHECK(below.ki_um_per_K == Approx(above.ki_um_per_K).epsilon(1e-6));
    CHECK(below.kc_um_per_K == Approx(above.kc_um_per_K).epsilon(1e-6));
  }
}

TEST_CASE("at the best height of the tie no other height displaces less", "[tiebar]") {
  const double ratio = GENERATE(0.0, 0.1, 0.3);
  const GateMachine gate = machine(1.1, 0.1);
  const BestHeight best = best_tie_height(columns_of(gate), ratio);
  for (double height_mm = 120; height_mm <= 1800; height_mm += 1) {
    GateMachine other = gate;
    other.tie_height_mm = height_mm;
    const TieCoefficients k = tie_coefficients(other);
    CHECK(std::abs(k.ki_um_per_K - ratio * k.kc_um_per_K) >=
          std::abs(best.displacement_um_per_K) - 1e-2);
  }
}

}  // namespace
}  // namespace thermocomp::identification
