#include "gate_structure.hpp"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

namespace thermocomp {
namespace {

constexpr double step_s = 20.0;

TEST_CASE("warm oil first moves tool and work together, then the tie moves them apart",
          "[tiebar][fe]") {
  bench::GateStructure gate(250.0, step_s);
  double early_um = 0.0;
  for (int step = 0; step < 180; ++step) {
    gate.advance({true, 40.0});
    early_um = std::max(early_um, gate.displacement_um());
  }
  CHECK(early_um > 10.0);
  CHECK(gate.displacement_um() < early_um - 10.0);
  CHECK(gate.theta_a_K() > gate.theta_b_K());
  CHECK(gate.theta_c_K() > 0.0);
  SECTION("and without oil everything cools") {
    const double before_K = gate.theta_a_K();
    for (int step = 0; step < 30; ++step) gate.advance({false, 40.0});
    CHECK(gate.theta_a_K() < before_K);
    CHECK(gate.theta_a_K() > 0.0);
  }
}

}  // namespace
}  // namespace thermocomp
