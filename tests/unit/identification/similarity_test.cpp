#include "modelling/identification/equation/similarity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <catch2/catch.hpp>

#include "config/runs/model_inputs.hpp"
#include "machine_runs.hpp"
#include "synthetic_places.hpp"

namespace thermocomp::identification {
namespace {

/// Two tests of three places, three rows each, that can be checked by hand.
MeasuredTests by_hand() {
  MeasuredTests tests;
  tests.places = {"a_degC", "b_degC", "c_degC"};
  TestRun run;
  run.name = "first";
  run.time_s = Eigen::Vector3d(0, 60, 120);
  run.places_K.resize(3, 3);
  run.places_K << 0, 0, 0,  //
      1, 2, 0,              //
      2, 4, 1;
  tests.runs.push_back(run);
  run.name = "second";
  run.places_K << 0, 0, 0,  //
      0, 0, 2,              //
      4, 7, -1;
  tests.runs.push_back(run);
  tests.folds = {{0, 0, 3}, {1, 0, 3}};
  return tests;
}

TEST_CASE("similarity equals a calculation by hand, with one factor over both tests", "[group]") {
  const MeasuredTests tests = by_hand();
  // a.a = 1+4+16 = 21, b.b = 4+16+49 = 69, a.b = 2+8+28 = 38, max a = 4
  const Eigen::MatrixXd sums = similarity(tests, false);
  CHECK(sums(0, 1) == Approx(21.0 / 16 - (38.0 / 4) * (38.0 / 4) / 69));
  CHECK(sums(1, 0) == Approx(69.0 / 49 - (38.0 / 7) * (38.0 / 7) / 21));
  CHECK(sums(0, 1) != Approx(sums(1, 0)));
  const Eigen::MatrixXd relative = similarity(tests, true);
  CHECK(relative(0, 1) == Approx(1.0 - 38.0 * 38.0 / (21.0 * 69.0)));
  CHECK(relative(1, 0) == Approx(relative(0, 1)));
}

TEST_CASE("with the maximum of each test, a test with small rises has the same weight", "[group]") {
  // a over its largest: 0, 1/2, 1 and 0, 0, 1; its square 2.25, times b 1 + 4 + 7 = 12, b.b = 69
  const MeasuredTests tests = by_hand();
  const Eigen::MatrixXd sums = similarity(tests, false, LargestOver::each_test);
  CHECK(sums(0, 1) == Approx(2.25 - 12.0 * 12.0 / 69));
  const Eigen::MatrixXd relative = similarity(tests, true, LargestOver::each_test);
  CHECK(relative(0, 1) == Approx(1.0 - 12.0 * 12.0 / (2.25 * 69.0)));
  MeasuredTests first = tests;  // with one test both are the same
  first.runs.resize(1);
  first.folds.resize(1);
  CHECK(similarity(first, false, LargestOver::each_test)(1, 0) ==
        Approx(similarity(first, false)(1, 0)).margin(1e-12));
}

TEST_CASE("places that move in opposite directions have nothing in common", "[group]") {
  // a.c = 2 - 4 < 0: alpha is 0, and all of a remains
  CHECK(similarity(by_hand(), true)(0, 2) == 1.0);
  CHECK(similarity(by_hand(), false)(0, 2) == Approx(21.0 / 16));
}

TEST_CASE("a threshold merges pairs in ascending order, and all merges are listed", "[group]") {
  Eigen::MatrixXd s(4, 4);
  s << 0, .01, .5, .9, .01, 0, .02, .8, .5, .02, 0, .7, .9, .8, .7, 0;
  CHECK(group_places(s, 0.015).groups == std::vector<std::vector<std::size_t>>{{0, 1}, {2}, {3}});
  const Grouping three = group_places(s, 0.02);
  CHECK(three.groups == std::vector<std::vector<std::size_t>>{{0, 1, 2}, {3}});
  REQUIRE(three.merges.size() == 3);
  CHECK(three.merges[2].threshold == 0.7);
  CHECK(three.merges[2].groups == 1);
  CHECK(group_places(s, 1.0).groups.size() == 1);
}

TEST_CASE("22 places in 9 groups are found at three noise levels and three sampling intervals",
          "[group]") {
  const std::vector<std::size_t> sizes{10, 5, 1, 1, 1, 1, 1, 1, 1};
  std::vector<std::vector<std::size_t>> truth;
  std::size_t next = 0;
  for (const std::size_t size : sizes) {
    std::vector<std::size_t>& group = truth.emplace_back();
    for (std::size_t i = 0; i < size; ++i) group.push_back(next++);
  }
  const double noise_K = GENERATE(0.01, 0.05, 0.1);
  const auto seed = GENERATE(1u, 2u, 3u);
  const int minutes = GENERATE(1, 10, 25);  // 25: one row per machining cycle
  MeasuredTests tests = grouped_places(sizes, noise_K, seed);
  for (TestRun& run : tests.runs) {
    const auto rows = Eigen::seq(0, Eigen::last, minutes);
    run.places_K = run.places_K(rows, Eigen::all).eval();
    run.time_s = run.time_s(rows).eval();
  }
  const Grouping grouping = group_places(similarity(tests, true), noise_floor(tests));
  CAPTURE(noise_K, minutes, grouping.threshold);
  CHECK(grouping.groups == truth);
}

/// An hour and a half of a warming place, a row each 30 s; x is probed each fifth minute, z 30 s
/// after it.
RunFile probed_one_after_another(std::size_t first_probed) {
  constexpr std::size_t rows = 180;
  const double none = std::numeric_limits<double>::quiet_NaN();
  RunFile run;
  run.name = "run.csv";
  run.columns = {"time_s", "head_degC", "x_um", "z_um"};
  run.values.resize(4);
  for (std::size_t row = 0; row < rows; ++row) {
    const double rise_K = 8.0 * (1.0 - std::exp(-static_cast<double>(row) / 60.0));
    run.values[0].push_back(30.0 * static_cast<double>(row));
    run.values[1].push_back(20.0 + rise_K);
    const bool is_due = row >= first_probed && row % 10 < 2;
    run.values[2].push_back(is_due && row % 10 == 0 ? 2.0 * rise_K : none);
    run.values[3].push_back(is_due && row % 10 == 1 ? 3.0 * rise_K : none);
  }
  run.selected_end = rows;
  return run;
}

bool has_note(const MeasuredTests& tests, const std::string& part) {
  return std::any_of(tests.notes.begin(), tests.notes.end(),
                     [&](const std::string& note) { return note.find(part) != std::string::npos; });
}

TEST_CASE("probings of two axes one after another are one row", "[identification]") {
  TestOptions options;
  options.outputs = {"x_um", "z_um"};
  const MeasuredTests tests = measured_tests({probed_one_after_another(0)}, options);
  CHECK(tests.rows() == 18);
  CHECK(has_note(tests, "18 sets of probings within 2 min"));
  CHECK_FALSE(has_note(tests, "min after the first temperatures"));
  RunFile apart = probed_one_after_another(0);
  std::swap(apart.values[3][21], apart.values[3][28]);  // 4 min after its x
  const MeasuredTests without = measured_tests({apart}, options);
  CHECK(without.rows() == 17);
  CHECK(has_note(without, "2 values without one of every other output"));
}

TEST_CASE("a first displacement long after the first temperatures is reported",
          "[identification]") {
  TestOptions options;
  options.outputs = {"x_um", "z_um"};
  const MeasuredTests tests = measured_tests({probed_one_after_another(50)}, options);
  CHECK(has_note(tests, "the first displacement is 26 min after the first temperatures"));
}

TEST_CASE("a stretch of an export with fewer than three displacements is left out",
          "[identification]") {
  std::string text = "time_s,t1_degC,z_um\n";
  for (int row = 0; row < 40; ++row) {
    const std::string second = std::to_string(10 * row);
    if (row == 10 || row == 25) text.append("# ").append(second).append(" s: command reference\n");
    text.append(second).append(",").append(std::to_string(20 + row)).append(",");
    if (row >= 10) text.append(std::to_string(row));
    text.append("\n");
  }
  TestOptions options;
  options.outputs = {"z_um"};
  const MeasuredTests tests =
      measured_tests(between_references(parse_run(text, "run.csv")), options);
  REQUIRE(tests.runs.size() == 2);
  CHECK(tests.runs[0].name == "run.csv@100:250");
  CHECK(tests.runs[1].outputs_um(0, 0) == 0.0);
  CHECK(has_note(tests, "run.csv@:100 is left out: fewer than 3 of its rows are complete"));
}

TEST_CASE("a first value far from the next ones is genuine in a record of few probings",
          "[identification]") {
  RunFile run = machine_run("run", 1, [](double quick, double, double, double) { return quick; });
  std::vector<double>& z_um = run.values[4];
  std::fill(z_um.begin(), z_um.end(), not_a_number);
  const std::vector<double> probed{0.0,   -12.8, -17.9, -18.2, -18.9, -19.4,
                                   -19.1, -18.8, -18.5, -18.9, -19.0, -18.7};
  for (std::size_t i = 0; i < probed.size(); ++i) z_um[25 * i] = probed[i];
  CHECK(leave_out_outliers(run, {"z_um"}).empty());
  z_um[100] = 320.0;
  CHECK(leave_out_outliers(run, {"z_um"}).size() == 1);
}

}  // namespace
}  // namespace thermocomp::identification
