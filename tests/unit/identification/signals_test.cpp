/// Tests of the gains that `fit` gives to operating signals, or refuses.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "config/model/model_file.hpp"
#include "config/runs/robust.hpp"
#include "machine_runs.hpp"
#include "modelling/identification/families/bank_fit.hpp"

using namespace thermocomp;
using namespace thermocomp::identification;

TEST_CASE("a signal at a constant level within each run is not requested from the controller",
          "[signals]") {
  std::vector<RunFile> files;
  std::mt19937_64 engine(3);
  for (std::size_t i = 0; i < 3; ++i) {
    RunFile run = machine_run(std::string("run").append(std::to_string(i)), i + 1,
                              [](double quick, double, double, double) { return 5.0 * quick; });
    run.columns[3] = "load_A";
    for (double& load_A : run.values[3])
      load_A = -2.0 * static_cast<double>(i + 1) + 0.02 * gaussian(engine);
    files.push_back(std::move(run));
  }
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  const MeasuredTests tests = measured_tests(files, options);
  const FamiliesFit fit = fitted(tests, Family::lag_bank);
  CHECK(tests.unmoved == std::vector<std::string>{"load_A"});
  CHECK(fit.model.signal_columns().empty());  // and no hinges
  CHECK_NOTHROW(parse_model(write_model(fit.model), "written"));
}

TEST_CASE("a position and a place that vary by rounding alone are constant", "[signals]") {
  RunFile run = machine_run("run", 1, [](double quick, double, double, double) { return quick; });
  run.columns[2] = "still_degC";
  run.columns[3] = "z_mm";
  for (std::size_t row = 0; row < run.rows(); ++row) {
    run.values[2][row] = 20.0 + (row % 2 == 0 ? 1e-13 : 0.0);
    run.values[3][row] = -150.0 + (row % 3 == 0 ? 3e-14 : 0.0);
  }
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  const MeasuredTests tests = measured_tests({run}, options);
  CHECK(tests.signals.empty());
  CHECK(tests.places == std::vector<std::string>{"t1_degC"});
}

TEST_CASE("a signal that changes in one direction once in all runs gets no gain", "[signals]") {
  const auto unmoved = [](std::initializer_list<double> levels) {
    RunFile run = machine_run("run", 1, [](double quick, double, double, double) { return quick; });
    run.columns[3] = "heater";
    const std::size_t rows = run.rows() / levels.size() + 1;
    for (std::size_t row = 0; row < run.rows(); ++row)
      run.values[3][row] = std::data(levels)[row / rows];
    TestOptions options;
    options.outputs = {"z_um"};
    options.signals = true;
    return !measured_tests({run}, options).moved("heater");
  };
  CHECK(unmoved({0.0, 60.0}));
  CHECK(unmoved({60.0, 30.0, 0.0}));
  CHECK(unmoved({0.0, 60.0, 57.0}));  // back by less than a tenth of its range
  CHECK_FALSE(unmoved({0.0, 60.0, 50.0}));
  CHECK_FALSE(unmoved({0.0, 60.0, 0.0, 60.0}));
}

TEST_CASE("a signal that goes one way gradually gets gains if all that is left out needs them",
          "[signals]") {
  const auto unmoved = [](double um_per_Ah, bool gradual) {
    RunFile run =
        machine_run("run", 1, [](double quick, double, double, double) { return 2.0 * quick; });
    run.columns[3] = "charge_Ah";
    for (std::size_t row = 0; row < run.rows(); ++row) {
      const double hour = static_cast<double>(row) / 60.0;
      run.values[3][row] = gradual ? hour + 0.4 * std::sin(2.0 * hour) : (hour > 4.0 ? 6.0 : 0.0);
      run.values[4][row] += um_per_Ah * run.values[3][row];
    }
    TestOptions options;
    options.outputs = {"z_um"};
    options.folds_of_one_run = 8;
    options.signals = true;
    const FamiliesFit fit = fitted(measured_tests({run}, options));
    CHECK(fit.model.signal_columns().empty() == !fit.unmoved.empty());
    return fit.unmoved;
  };
  CHECK(unmoved(10.0, true).empty());
  CHECK(unmoved(0.0, true) == std::vector<std::string>{"charge_Ah"});
  CHECK(unmoved(10.0, false) == std::vector<std::string>{"charge_Ah"});
}

TEST_CASE("two levels of a speed show no square, three do", "[signals]") {
  std::vector<RunFile> files;
  std::mt19937_64 engine(5);
  const auto subjects = [&](double noise_rpm) {
    for (RunFile& run : files)
      for (double& rpm : run.values[3]) rpm += noise_rpm * gaussian(engine);
    TestOptions options;
    options.outputs = {"z_um"};
    options.signals = true;
    return bank_columns(measured_tests(files, options)).subjects;
  };
  const auto quickly = [](double quick, double, double, double) { return quick; };
  const std::vector<std::string> linear{"t1_degC", "t2_degC", "spindle_rpm"};
  files = {machine_run("run", 1, quickly)};
  CHECK(subjects(0.0) == linear);
  CHECK(subjects(20.0) == linear);  // as measured
  files = {machine_run("run1", 1, quickly), machine_run("run2", 3, quickly)};
  CHECK(subjects(0.0).size() == linear.size() + 1);
}

TEST_CASE("signals that never moved, or only together, are named", "[signals]") {
  std::vector<RunFile> files;
  for (const std::uint64_t seed : {std::uint64_t{1}, std::uint64_t{2}}) {
    RunFile run = machine_run(std::string("run").append(std::to_string(seed)), seed,
                              [](double quick, double, double, double) { return 5.0 * quick; });
    run.columns.insert(run.columns.end(), {"feed_mm_per_min", "oil_on"});
    run.values.push_back(run.values[3]);
    run.values.emplace_back(run.rows(), 1.0);
    files.push_back(std::move(run));
  }
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  const MeasuredTests tests = measured_tests(files, options);
  CHECK(tests.constant == std::vector<std::string>{"oil_on"});
  const FamiliesFit fit = fitted(tests);
  CHECK(fit.together == std::vector<std::vector<std::string>>{{"spindle_rpm", "feed_mm_per_min"}});
  CHECK(std::any_of(fit.warnings.begin(), fit.warnings.end(), [](const std::string& warning) {
    return warning.starts_with("oil_on: the same value in all rows");
  }));
}

TEST_CASE("a signal that moves between probings has moved", "[families]") {
  RunFile run = machine_run("run", 1, [](double quick, double, double, double) { return quick; });
  const double usual_rpm = run.values[3][0];
  for (std::size_t row = 0; row < run.values[4].size(); ++row)
    if (run.values[3][row] != usual_rpm) run.values[4][row] = not_a_number;
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  CHECK(measured_tests({run}, options).moved("spindle_rpm"));
}

TEST_CASE("rows after the last probing do not show that a signal moved", "[signals]") {
  RunFile run = machine_run("run", 1, [](double quick, double, double, double) { return quick; });
  for (std::size_t row = 0; row < run.values[3].size(); ++row) {
    run.values[3][row] = row < 100 || row >= 320 ? 0.0 : 1.0;
    if (row >= 300) run.values[4][row] = not_a_number;
  }
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  CHECK_FALSE(measured_tests({run}, options).moved("spindle_rpm"));
}

TEST_CASE("a stray value of a signal is left out of the fit", "[families]") {
  RunFile run = machine_run("run", 1, [](double quick, double, double, double) { return quick; });
  run.values[3][100] = 65535.0;
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  const MeasuredTests tests = measured_tests({run}, options);
  CHECK(tests.rows() == static_cast<Eigen::Index>(run.values[0].size()) - 1);
  CHECK(tests.moved("spindle_rpm"));
  CHECK(tests.notes.size() == 1);
}

TEST_CASE("a burst of a signal is no stray value", "[signals]") {
  std::vector<double> power_W(900, 100.0);
  for (std::size_t i = 0; i < 4; ++i) power_W[500 + i] = 3000.0 + 1000.0 * static_cast<double>(i);
  CHECK(stray_rows(power_W).empty());
  power_W.assign(900, 100.0);
  power_W[500] = power_W[501] = 65535.0;  // one code, twice
  CHECK(stray_rows(power_W) == std::vector<std::size_t>{500, 501});
  power_W[502] = 600.0;  // not beyond five times of what is kept, nor the code
  CHECK(stray_rows(power_W).empty());
}

TEST_CASE("a place that is missing in one stretch of an export leaves out that stretch only",
          "[signals]") {
  RunFile run = machine_run("run", 1, [](double quick, double, double, double) { return quick; });
  run.references = {100, 200};
  for (std::size_t row = 100; row < 200; ++row) run.values[1][row] = not_a_number;
  TestOptions options;
  options.outputs = {"z_um"};
  const MeasuredTests tests = measured_tests(between_references(run), options);
  CHECK(tests.places == std::vector<std::string>{"t1_degC", "t2_degC"});
  CHECK(tests.given == std::vector<std::size_t>{0, 2});
  REQUIRE(tests.notes.size() == 1);
  CHECK(tests.notes[0] == "run@6000:12000 is left out: fewer than 3 of its rows are complete");
}
