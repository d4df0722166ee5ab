#include "modelling/identification/gate/tied_columns.hpp"

#include <cmath>

#include <catch2/catch.hpp>

namespace thermocomp::identification {
namespace {

TiedColumns gate() {
  TiedColumns columns;
  columns.working_height_mm = 600;
  columns.heated_height_mm = 300;
  columns.column_width_mm = 80;
  columns.column_inertia_mm4 = 60.0 * 80 * 80 * 80 / 12;
  columns.column_modulus_MPa = 206000;
  columns.column_expansion_per_K = 11.5e-6;
  return columns;
}

Tie tie(double height_mm, double area_mm2) {
  return {height_mm, 400, area_mm2, 206000, 11.5e-6};
}

TEST_CASE("one tie gives the published cases", "[tiebar]") {
  const double area_mm2 = GENERATE(10.0, 150.0, 5000.0);
  for (double height_mm = 100; height_mm < 1500; height_mm += 25) {
    TiedColumns columns = gate();
    columns.ties = {tie(height_mm, area_mm2)};
    const TiedCoefficients k = tied_coefficients(columns);
    const TieCoefficients published = tie_coefficients(machine_of(columns));
    CAPTURE(height_mm, area_mm2);
    CHECK(k.ki_um_per_K == Approx(published.ki_um_per_K).epsilon(1e-12).margin(1e-11));
    REQUIRE(k.kc_um_per_K.size() == 1);
    CHECK(k.kc_um_per_K[0] == Approx(published.kc_um_per_K).epsilon(1e-12));
  }
}

TEST_CASE("without a tie only the bending of the heated column is left", "[tiebar]") {
  const TiedCoefficients k = tied_coefficients(gate());
  CHECK(k.ki_um_per_K == Approx(1000 * 3 * 11.5e-6 * 600 * 600 / (8 * 80)));
  CHECK(k.kc_um_per_K.empty());
}

TEST_CASE("two half ties at one height are a whole one", "[tiebar]") {
  TiedColumns whole = gate();
  whole.ties = {tie(700, 300)};
  TiedColumns halves = gate();
  halves.ties = {tie(700, 150), tie(700, 150)};
  const TiedCoefficients one = tied_coefficients(whole);
  const TiedCoefficients two = tied_coefficients(halves);
  CHECK(two.ki_um_per_K == Approx(one.ki_um_per_K).epsilon(1e-10));
  CHECK(two.kc_um_per_K[0] + two.kc_um_per_K[1] == Approx(one.kc_um_per_K[0]).epsilon(1e-10));
}

TEST_CASE("a tie that bears nothing changes nothing, and the order of ties does not matter",
          "[tiebar]") {
  TiedColumns one = gate();
  one.ties = {tie(250, 150)};
  TiedColumns two = one;
  two.ties.push_back(tie(700, 1e-9));
  CHECK(tied_coefficients(two).ki_um_per_K ==
        Approx(tied_coefficients(one).ki_um_per_K).epsilon(1e-9));
  two.ties[1] = tie(800, 90);
  TiedColumns turned = two;
  std::swap(turned.ties[0], turned.ties[1]);
  const TiedCoefficients k = tied_coefficients(two);
  const TiedCoefficients other = tied_coefficients(turned);
  CHECK(other.ki_um_per_K == Approx(k.ki_um_per_K).epsilon(1e-12));
  CHECK(other.kc_um_per_K[1] == Approx(k.kc_um_per_K[0]).epsilon(1e-12));
  CHECK(other.kc_um_per_K[0] == Approx(k.kc_um_per_K[1]).epsilon(1e-12));
}

TEST_CASE("two rigid ties, one above the work and one below, leave less than either alone",
          "[tiebar]") {
  TiedColumns columns = gate();
  const auto ki = [&](std::vector<Tie> ties) {
    columns.ties = std::move(ties);
    return std::abs(tied_coefficients(columns).ki_um_per_K);
  };
  const double both = ki({tie(400, 1e5), tie(750, 1e5)});
  CHECK(both < 0.5 * ki({tie(400, 1e5)}));
  CHECK(both < 0.5 * ki({tie(750, 1e5)}));
}

}  // namespace
}  // namespace thermocomp::identification
