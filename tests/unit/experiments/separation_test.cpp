#include "modelling/experiments/separation.hpp"

#include <cmath>

#include <catch2/catch.hpp>

namespace thermocomp::experiments {
namespace {

using identification::MeasuredTests;
using identification::TestRun;

TestRun run_of(const std::vector<double>& hours, const std::vector<std::vector<double>>& places_K,
               const std::vector<std::vector<double>>& signals = {}) {
  TestRun run;
  const auto rows = static_cast<Eigen::Index>(hours.size());
  run.time_s = 3600.0 * Eigen::Map<const Eigen::VectorXd>(hours.data(), rows);
  run.places_K.resize(rows, static_cast<Eigen::Index>(places_K.size()));
  run.signals.resize(rows, static_cast<Eigen::Index>(signals.size()));
  for (std::size_t i = 0; i < places_K.size(); ++i)
    run.places_K.col(static_cast<Eigen::Index>(i)) =
        Eigen::Map<const Eigen::VectorXd>(places_K[i].data(), rows);
  for (std::size_t i = 0; i < signals.size(); ++i)
    run.signals.col(static_cast<Eigen::Index>(i)) =
        Eigen::Map<const Eigen::VectorXd>(signals[i].data(), rows);
  return run;
}

/// One place rises at 3 K/h for `hours` / 2 and falls again, the other rests.
TestRun moved_apart(double hours) {
  std::vector<double> time_h;
  std::vector<double> moved_K;
  for (int row = 0; row <= 200; ++row) {
    time_h.push_back(hours * row / 200.0);
    moved_K.push_back(3.0 * std::min(time_h.back(), hours - time_h.back()));
  }
  return run_of(time_h, {moved_K, std::vector<double>(201, 0.0)});
}

}  // namespace

TEST_CASE("the shortest run that separates two places matches the manual calculation",
          "[plan][apart]") {
  MeasuredTests tests;
  tests.places = {"bed_degC", "nozzle_degC"};
  tests.runs.push_back(run_of({0, 1, 2}, {{0, 3, 0}, {0, 6, 0}}));
  const Separation found = separation(tests);
  // S = 1 + 4 + 1 = 6 K^2 h, D = 6 (1 / 0.81 - 1) = 1.4074, t^3 = 48 D / 3^2 = 7.5062.
  REQUIRE(found.moves.size() == 1);
  const Move& move = found.moves[0];
  CHECK(move.column == "bed_degC");
  CHECK(move.rest == std::vector<std::string>{"nozzle_degC"});
  CHECK(move.correlation == Approx(1.0));
  CHECK(move.hours == Approx(1.95797).epsilon(1e-5));
  CHECK(move.swing == Approx(2.93696).epsilon(1e-5));
  CHECK(found.recorded_h == Approx(2.0));

  // r^2 = S / (S + D) = 0.81 with it; a quarter of the time adds D / 64.
  tests.runs.push_back(moved_apart(move.hours));
  CHECK(separation(tests).moves.empty());
  tests.runs.back() = moved_apart(move.hours / 4.0);
  CHECK(separation(tests).moves.size() == 1);
}

TEST_CASE("a place with a limited range is moved several times", "[plan][apart]") {
  MeasuredTests tests;
  tests.places = {"a_degC", "b_degC"};
  // Up in an hour, down in another, five times: S = 5 (4 + 1) + 6 about the mean 15 / 11.
  const std::vector<double> a_K{0, 3, 0, 3, 0, 3, 0, 3, 0, 3, 0};
  tests.runs.push_back(run_of({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10}, {a_K, a_K}));
  const Separation found = separation(tests);
  REQUIRE(found.moves.size() == 1);
  // S = 45 - 225 / 11 = 24.5455, D = 5.75758; once up and down: 3.131 h and 4.7 K, more than 3 K.
  CHECK(found.moves[0].hours == Approx(12.0 * 5.75758 / 9.0).epsilon(1e-5));
  CHECK(found.moves[0].swing == 3.0);
}

TEST_CASE("signals that were always on together, and one that never returned, are reported",
          "[plan][apart]") {
  MeasuredTests tests;
  tests.signals = {"coolant_on", "pump_on", "door_on", "spindle_rpm"};
  tests.unmoved = {"door_on"};
  tests.runs.push_back(
      run_of({0, 1, 2, 3}, {}, {{0, 1, 1, 0}, {0, 1, 1, 0}, {0, 0, 1, 1}, {0, 4000, 0, 4000}}));
  const Separation found = separation(tests);
  REQUIRE(found.moves.size() == 1);
  CHECK(found.moves[0].column == "coolant_on");
  CHECK(found.moves[0].rest == std::vector<std::string>{"pump_on"});
  // S = 4 x 0.25 = 1 h, t = 4 (1 / 0.81 - 1) / 1.
  CHECK(found.moves[0].hours == Approx(0.938272).epsilon(1e-5));
  CHECK(found.unmoved == std::vector<std::string>{"door_on"});
  CHECK(separation_text(found).find("door_on was constant within each run") != std::string::npos);
}

}  // namespace thermocomp::experiments
