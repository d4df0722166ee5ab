#include "modelling/identification/gate/tied_columns.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

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

/// Its tie at l / a, with km / kc = beta a^3.
TiedColumns gate_with_tie(double a, double beta) {
  TiedColumns columns = gate();
  columns.ties = {tie(600 / a, 3.0 * columns.column_inertia_mm4 * 400 / (beta * 600 * 600 * 600))};
  return columns;
}

TEST_CASE("one tie gives the published cases, dimensionless", "[tiebar]") {
  const double beta = GENERATE(0.01, 0.1, 1.0);
  for (double a = 0.4; a < 4.0; a += 0.05) {
    const double q = beta * a * a * a + 2;
    const double ki = a >= 2   ? 1 - 4 * (3 * a - 1) / (3 * a * a * q)
                      : a >= 1 ? 1 - (3 * a - 1) * (4 - a) / (3 * a * q)
                               : 1 - a * (3 - a) * (4 - a) / (3 * q);
    const double kc = a >= 1 ? (3 * a - 1) / q : a * a * (3 - a) / q;
    const TiedColumns columns = gate_with_tie(a, beta);
    const TiedCoefficients k = tied_coefficients(columns);
    CAPTURE(a, beta);
    CHECK(stiffness_ratio(columns) == Approx(beta * a * a * a));
    CHECK(k.ki_um_per_K / (1000 * 3 * 11.5e-6 * 600 * 600 / (8 * 80)) == Approx(ki).margin(1e-12));
    REQUIRE(k.kc_um_per_K.size() == 1);
    CHECK(k.kc_um_per_K[0] / (1000 * 11.5e-6 * 400) == Approx(kc));
  }
}

TEST_CASE("no other height of the tie displaces less than the best one", "[tiebar]") {
  const double ratio = GENERATE(0.0, 0.1, 0.3);
  TiedColumns columns = gate_with_tie(1.1, 0.1);
  const BestHeight best = best_tie_height(columns, ratio);
  for (double height_mm = 120; height_mm <= 1800; height_mm += 1) {
    columns.ties[0].height_mm = height_mm;
    const TiedCoefficients k = tied_coefficients(columns);
    CHECK(std::abs(k.ki_um_per_K - ratio * k.kc_um_per_K[0]) >=
          std::abs(best.displacement_um_per_K) - 1e-2);
  }
}

TEST_CASE("without a tie only the heated column's bending remains", "[tiebar]") {
  const TiedCoefficients k = tied_coefficients(gate());
  CHECK(k.ki_um_per_K == Approx(1000 * 3 * 11.5e-6 * 600 * 600 / (8 * 80)));
  CHECK(k.kc_um_per_K.empty());
}

TEST_CASE("two half ties at one height equal a whole one", "[tiebar]") {
  TiedColumns whole = gate();
  whole.ties = {tie(700, 300)};
  TiedColumns halves = gate();
  halves.ties = {tie(700, 150), tie(700, 150)};
  const TiedCoefficients one = tied_coefficients(whole);
  const TiedCoefficients two = tied_coefficients(halves);
  CHECK(two.ki_um_per_K == Approx(one.ki_um_per_K).epsilon(1e-10));
  CHECK(two.kc_um_per_K[0] + two.kc_um_per_K[1] == Approx(one.kc_um_per_K[0]).epsilon(1e-10));
}

TEST_CASE("a tie without stiffness changes nothing, and the order of ties is irrelevant",
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

/// With everything that the publication neglects.
TiedColumns elastic_gate() {
  TiedColumns columns = gate();
  columns.column_poisson_ratio = 0.3;
  columns.column_shear_compliance_per_N = 2.0 * 1.3 / (206000 * 4000.0);
  columns.foot_length_mm = held_foot_length_mm(80, 60, 0.3);
  return columns;
}

Tie bonded_tie(double height_mm, double area_mm2, double thickness_mm) {
  Tie bonded = tie(height_mm, area_mm2);
  bonded.thickness_mm = thickness_mm;
  return bonded;
}

TEST_CASE("shear, the foot and bonded ends each change the published Ki", "[tiebar]") {
  TiedColumns columns = gate();
  columns.ties = {tie(250, 150)};
  const double published = tied_coefficients(columns).ki_um_per_K;
  const auto differs = [&](const TiedColumns& other) {
    return std::abs(tied_coefficients(other).ki_um_per_K / published - 1);
  };
  TiedColumns other = columns;
  other.column_shear_compliance_per_N = elastic_gate().column_shear_compliance_per_N;
  CHECK(differs(other) > 0.005);
  other = columns;
  other.foot_length_mm = elastic_gate().foot_length_mm;
  CHECK(differs(other) > 0.005);
  other = columns;
  other.ties = {bonded_tie(250, 150, 12.5)};
  CHECK(differs(other) > 0.005);
}

TEST_CASE("a stiff bonded tie above the heated zone removes the displacement at the work",
          "[tiebar]") {
  TiedColumns columns = gate();  // nu = 0: the section keeps its width
  columns.column_poisson_ratio = 0.0;
  const double free_um_per_K = tied_coefficients(columns).ki_um_per_K;
  const double height_mm = GENERATE(400.0, 600.0);
  Tie stiff = bonded_tie(height_mm, 12000, 200);  // too large to sink in
  stiff.modulus_MPa = 1e12;
  columns.ties = {stiff};
  CHECK(std::abs(tied_coefficients(columns).ki_um_per_K) < 1e-5 * free_um_per_K);
  SECTION("pinned it leaves the tilt") {
    columns.ties[0].thickness_mm = 0;
    const double ki_um_per_K = std::abs(tied_coefficients(columns).ki_um_per_K);
    CHECK((ki_um_per_K > 0.01 * free_um_per_K) == (height_mm < 600));
  }
}

TEST_CASE("bonded and pinned ties may be mixed in any order", "[tiebar]") {
  TiedColumns columns = elastic_gate();
  columns.ties = {bonded_tie(250, 150, 12.5), tie(500, 90), bonded_tie(750, 300, 12.5)};
  TiedColumns turned = columns;
  std::reverse(turned.ties.begin(), turned.ties.end());
  const TiedCoefficients k = tied_coefficients(columns);
  const TiedCoefficients other = tied_coefficients(turned);
  CHECK(other.ki_um_per_K == Approx(k.ki_um_per_K).epsilon(1e-10));
  for (std::size_t j = 0; j < 3; ++j)
    CHECK(other.kc_um_per_K[j] == Approx(k.kc_um_per_K[2 - j]).epsilon(1e-10));
}

TEST_CASE("Ki of a bonded tie is continuous at the end of the heated zone", "[tiebar]") {
  TiedColumns columns = elastic_gate();
  const auto ki = [&](double height_mm) {
    columns.ties = {bonded_tie(height_mm, 150, 12.5)};
    return tied_coefficients(columns).ki_um_per_K;
  };
  CHECK(ki(300.001) == Approx(ki(299.999)).epsilon(1e-4));
  CHECK(ki(306.251) == Approx(ki(306.249)).epsilon(1e-4));
}

}  // namespace
}  // namespace thermocomp::identification
