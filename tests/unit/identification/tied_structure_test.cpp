#include "tied_structure.hpp"

#include <cmath>
#include <cstdio>
#include <vector>

#include <catch2/catch.hpp>

namespace thermocomp::gate_tests {
namespace {

/// The publication's columns: rigid in shear, feet free crosswise, ties pinned to the axes.
identification::TiedColumns published(identification::TiedColumns columns) {
  columns.column_poisson_ratio = 0.0;
  columns.column_shear_compliance_per_N = 0.0;
  columns.foot_length_mm = 0.0;
  for (identification::Tie& tie : columns.ties) tie.thickness_mm = 0.0;
  return columns;
}

void print_ties(const std::vector<FiniteTie>& ties) {
  for (const FiniteTie& tie : ties)
    std::printf("%.0f mm, %.0f mm^2; ", tie.height_mm, tie.area_mm2);
}

/// Four beam models: the publication's, then with shear, with held feet, and with bonded ties.
std::vector<identification::TiedCoefficients> beams_of(const identification::TiedColumns& all) {
  identification::TiedColumns columns = published(all);
  std::vector<identification::TiedCoefficients> beams{identification::tied_coefficients(columns)};
  columns.column_poisson_ratio = all.column_poisson_ratio;
  columns.column_shear_compliance_per_N = all.column_shear_compliance_per_N;
  beams.push_back(identification::tied_coefficients(columns));
  columns.foot_length_mm = all.foot_length_mm;
  beams.push_back(identification::tied_coefficients(columns));
  beams.push_back(identification::tied_coefficients(all));
  return beams;
}

/// Prints the deviations in percent of `whole`.
template <class Value>
void print_off(const char* name, double fe,
               const std::vector<identification::TiedCoefficients>& beams, Value value,
               double whole) {
  std::printf(
      "%s %.4f um/K, published %+.1f %%, with shear %+.1f %%, feet %+.1f %%, all %+.1f %%; ", name,
      fe, 100 * (value(beams[0]) - fe) / whole, 100 * (value(beams[1]) - fe) / whole,
      100 * (value(beams[2]) - fe) / whole, 100 * (value(beams[3]) - fe) / whole);
}

double ki_of(const identification::TiedCoefficients& k) {
  return k.ki_um_per_K;
}

TEST_CASE("one tie and two agree with finite elements of the gate machine", "[tiebar][fe]") {
  // Below the work in the heated zone and above it, at the work, and above; then two unequal ties.
  const auto ties = GENERATE(std::vector<FiniteTie>{{150, 150}}, std::vector<FiniteTie>{{400, 150}},
                             std::vector<FiniteTie>{{600, 600}}, std::vector<FiniteTie>{{900, 150}},
                             std::vector<FiniteTie>{{400, 150}, {900, 300}});
  const TiedStructure gate(ties);
  const auto fe = gate.coefficients();
  const auto beams = beams_of(gate.columns());
  const auto& beam = beams.back();
  print_ties(ties);
  print_off("Ki", fe.ki_um_per_K, beams, ki_of, fe.ki_um_per_K);
  CAPTURE(ties.size(), ties[0].height_mm);
  CHECK(std::abs(beam.ki_um_per_K - fe.ki_um_per_K) <= 0.03 * std::abs(fe.ki_um_per_K));
  REQUIRE(fe.kc_um_per_K.size() == beam.kc_um_per_K.size());
  for (std::size_t j = 0; j < fe.kc_um_per_K.size(); ++j) {
    const double kc = fe.kc_um_per_K[j];
    print_off(
        "Kc", kc, beams, [j](const auto& k) { return k.kc_um_per_K[j]; }, kc);
    CAPTURE(j);
    CHECK(std::abs(beam.kc_um_per_K[j] - kc) <= 0.03 * kc);
  }
  std::printf("\n");
}

TEST_CASE("beams agree with finite elements where a tie nearly cancels Ki", "[tiebar][fe]") {
  const double height_mm = GENERATE(500.0, 560.0);
  const std::vector<FiniteTie> ties{{height_mm, 1200}};
  const TiedStructure gate(ties);
  identification::TiedColumns free = gate.columns();
  free.ties.clear();
  const double free_um_per_K = identification::tied_coefficients(free).ki_um_per_K;
  const double fe = gate.coefficients().ki_um_per_K;
  const auto beams = beams_of(gate.columns());
  print_ties(ties);
  print_off("of Ki without a tie: Ki", fe, beams, ki_of, free_um_per_K);
  std::printf("\n");
  CHECK(std::abs(fe) < 0.01 * free_um_per_K);
  CHECK(std::abs(beams.back().ki_um_per_K - fe) < 0.002 * free_um_per_K);
}

}  // namespace
}  // namespace thermocomp::gate_tests
