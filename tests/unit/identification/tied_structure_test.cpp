#include "tied_structure.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "modelling/identification/gate/tie_course.hpp"

namespace thermocomp::gate_tests {
namespace {

constexpr double step_s = 20.0;

/// The publication's: rigid in shear, feet free crosswise, ties pinned to the axes.
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

/// Beams of four kinds: the publication's, then with shear, on held feet, and with bonded ties too.
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

/// How far they are off, in percent of `whole`.
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

TEST_CASE("one tie and two are what finite elements of the gate machine say", "[tiebar][fe]") {
  // Below the work in the heated zone and above it, at the work, and above; then two of two sizes.
  const auto ties = GENERATE(std::vector<FiniteTie>{{150, 150}}, std::vector<FiniteTie>{{400, 150}},
                             std::vector<FiniteTie>{{600, 600}}, std::vector<FiniteTie>{{900, 150}},
                             std::vector<FiniteTie>{{400, 150}, {900, 300}});
  const TiedStructure gate(ties, step_s, Elements::refined);
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

TEST_CASE("where a tie leaves nearly nothing of Ki, beams are right to parts of Ki without a tie",
          "[tiebar][fe]") {
  const double height_mm = GENERATE(500.0, 560.0);
  const std::vector<FiniteTie> ties{{height_mm, 1200}};
  const TiedStructure gate(ties, step_s, Elements::refined);
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

struct Oil {
  bool in_tank{true};
  double temp_degC{40.0};
};

/// Oil on for odd hours and off for even ones, its heater started with the test in the second
/// condition; or as the third condition has it. As in bench/gate_machine/gate_machine.cpp.
Oil oil_at(int condition, double hour) {
  Oil oil;
  oil.in_tank = condition == 3 ? hour < 3 || hour >= 4 : static_cast<int>(hour) % 2 == 0;
  if (condition == 2) oil.temp_degC = 40.0 - 20.0 * std::exp(-hour / 0.25);
  if (condition == 3 && hour >= 1 && hour < 2) oil.temp_degC = 20.0;
  return oil;
}

struct Measured {
  std::vector<identification::TieCourse> courses;
  std::vector<double> swings_um;  ///< of the finite elements themselves
};

/// Five hours of each condition.
Measured measured(const std::vector<FiniteTie>& ties) {
  constexpr int steps = 5 * 3600 / static_cast<int>(step_s);
  Measured result;
  for (const int condition : {1, 2, 3}) {
    TiedStructure gate(ties, step_s);
    identification::TieCourse course{
        "condition " + std::to_string(condition), Eigen::VectorXd::Zero(steps + 1),
        Eigen::MatrixXd::Zero(steps + 1, 1 + static_cast<Eigen::Index>(ties.size()))};
    double least_um = 0.0;
    double most_um = 0.0;
    for (int step = 0; step < steps; ++step) {
      const Oil oil = oil_at(condition, step * step_s / 3600);
      gate.advance(oil.in_tank, oil.temp_degC);
      course.time_s[step + 1] = (step + 1) * step_s;
      course.rises_K(step + 1, 0) = gate.theta_a_K() - gate.theta_b_K();
      for (std::size_t j = 0; j < ties.size(); ++j)
        course.rises_K(step + 1, 1 + static_cast<Eigen::Index>(j)) = gate.theta_c_K(j);
      least_um = std::min(least_um, gate.displacement_um());
      most_um = std::max(most_um, gate.displacement_um());
    }
    result.courses.push_back(std::move(course));
    result.swings_um.push_back(most_um - least_um);
  }
  return result;
}

/// The machine with its ties free to move and to become stiffer within bounds; of two the first is
/// below the work and the second above.
identification::GateFile free_to_choose(const identification::TiedColumns& columns,
                                        bool first_stays) {
  identification::GateFile file;
  file.name = "gate machine";
  file.columns = columns;
  const bool alone = columns.ties.size() == 1;
  for (std::size_t j = 0; j < columns.ties.size(); ++j) {
    identification::TieChoice choice;
    choice.height_mm = {j == 0 ? 120.0 : 610.0, j == 0 && !alone ? 590.0 : 900.0};
    choice.area_mm2 = {40, 600};
    if (j == 0 && first_stays) {
      choice.height_mm = {columns.ties[j].height_mm, columns.ties[j].height_mm};
      choice.area_mm2 = {columns.ties[j].area_mm2, columns.ties[j].area_mm2};
    }
    file.choices.push_back(choice);
  }
  return file;
}

void print(const char* title, const std::vector<FiniteTie>& ties, const Measured& said) {
  const auto columns = published(TiedStructure(ties, step_s).columns());
  std::printf("%s: ", title);
  print_ties(ties);
  for (std::size_t i = 0; i < said.courses.size(); ++i)
    std::printf(
        " condition %zu: %.1f um by beams, %.1f um by FE;", i + 1,
        identification::swing_um({said.courses[i]}, identification::tied_coefficients(columns)),
        said.swings_um[i]);
  std::printf("\n");
}

/// Run by name only: minutes. The ties are chosen twice, the second time from the temperatures that
/// the first choice has itself, since a tie elsewhere is not as warm.
TEST_CASE("figures: what chosen ties leave in three oil conditions", "[.][tie_figures]") {
  const int kind = GENERATE(1, 2, 3);  // one tie; one that stays and a second; two
  const bool first_stays = kind == 2;
  std::vector<FiniteTie> ties{{250, 150}};
  if (kind > 1) ties.push_back({750, 150});
  Measured now = measured(ties);
  print("as drawn", ties, now);
  const double drawn_um = now.swings_um.front();
  for (const char* title : {"chosen", "chosen again"}) {
    const identification::TiedColumns best = identification::best_ties(
        free_to_choose(published(TiedStructure(ties, step_s).columns()), first_stays), now.courses);
    for (std::size_t j = 0; j < ties.size(); ++j)
      ties[j] = {best.ties[j].height_mm, best.ties[j].area_mm2};
    now = measured(ties);
    print(title, ties, now);
  }
  CHECK(now.swings_um.front() < drawn_um);
}

}  // namespace
}  // namespace thermocomp::gate_tests
