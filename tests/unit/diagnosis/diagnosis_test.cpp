#include "modelling/diagnosis/diagnosis.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/QR>
#include <catch2/catch.hpp>

#include "config/model/model_file.hpp"
#include "config/runs/run_file.hpp"
#include "config/text/problems.hpp"
#include "modelling/diagnosis/answer/diagnosis_report.hpp"
#include "modelling/diagnosis/rank/search.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

ThermalModel one_input() {
  ThermalModel model;
  model.inputs = {"t1_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{5.0}};
  return model;
}

/// A run of `rows` minutes: t1 follows the speed's steps; z = 5 t1 + hidden(speed, rise, row).
template <class Hidden>
RunFile run_with(unsigned seed, int rows, Hidden hidden) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.1);
  std::uniform_int_distribution<int> speed(0, 3);
  RunFile run;
  run.name = "run.csv";
  run.columns = {"time_s", "t1_degC", "spindle_rpm", "z_um"};
  run.values.resize(4);
  double rise_K = 0.0;
  double rpm = 0.0;
  for (int row = 0; row < rows; ++row) {
    if (row % 50 == 20) rpm = 1500.0 * speed(random);
    rise_K += (rpm / 500.0 - rise_K) / 40.0;
    run.values[0].push_back(60.0 * row);
    run.values[1].push_back(20.0 + rise_K);
    run.values[2].push_back(rpm);
    run.values[3].push_back(5.0 * rise_K + hidden(rpm, rise_K, row) + noise(random));
  }
  run.selected_end = run.rows();
  return run;
}

template <class Hidden>
Diagnosis diagnosis_of(Hidden hidden) {
  return diagnose(one_input(), {run_with(1, 600, hidden)}, {run_with(2, 400, hidden)});
}

struct FoundGain {
  double value;
  double sd;
  double reach;  ///< to both ends of its interval
};

/// Of the first finding in one run.
template <class Hidden>
FoundGain found_gain(Hidden hidden) {
  std::vector<RunFile> runs = {run_with(1, 600, hidden)};
  // Without the speed, whose heat would be as good a name.
  runs[0].columns.erase(runs[0].columns.begin() + 2);
  runs[0].values.erase(runs[0].values.begin() + 2);
  const MeasuredData data = measured_data(one_input(), runs, shared_columns(one_input(), runs));
  const std::vector<Hypothesis> all = hypotheses(data);
  const SearchResult result = search(data, all);
  REQUIRE_FALSE(result.findings.empty());
  const Finding& found = result.findings.front();
  const Interval& of = found.gains_ci[0][0];
  return {found.explanation.gains[0][0], found.explanation.gain_sd[0][0], 0.5 * (of.high - of.low)};
}

/// A day that begins at `start_degC`; z = 5 t1 + hidden(start_degC, rise, late), late being the
/// speed after JP7689460B2's 90 % in 30 min.
template <class Hidden>
RunFile day_from(unsigned seed, double start_degC, Hidden hidden) {
  double late_rpm = 0.0;
  RunFile run = run_with(seed, 500, [&](double rpm, double rise_K, int) {
    late_rpm += (rpm - late_rpm) * -std::expm1(-60.0 / 781.7);
    return hidden(start_degC, rise_K, late_rpm);
  });
  for (double& temp_degC : run.values[1]) temp_degC += start_degC - 20.0;
  return run;
}

const Parameter& parameter(const NamedFinding& finding, const std::string& name) {
  const auto at = std::find_if(finding.parameters.begin(), finding.parameters.end(),
                               [&](const Parameter& each) { return each.name == name; });
  REQUIRE(at != finding.parameters.end());
  return *at;
}

template <class Hidden>
Diagnosis diagnosis_of_days(Hidden hidden) {
  return diagnose(one_input(),
                  {day_from(1, 16.0, hidden), day_from(2, 20.0, hidden), day_from(3, 25.0, hidden),
                   day_from(4, 22.0, hidden)},
                  {day_from(5, 18.0, hidden), day_from(6, 24.0, hidden)});
}

/// A machine that the readings move, each of which follows the speed in its own time.
struct MeasuredMachine {
  std::vector<double> per_row;   ///< share of what it lacks that a reading rises in a row
  std::vector<double> um_per_K;  ///< as the model has them
  std::vector<double> factor;    ///< of the machine's coefficients to the model's
  double heat_um{0.0};           ///< what a heat that no reading shows adds at 4500 rpm

  [[nodiscard]] RunFile run(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, 0.1);
    std::uniform_int_distribution<int> speed(0, 3);
    RunFile run;
    run.name = "run.csv";
    run.columns = {"time_s", "spindle_rpm", "z_um"};
    run.values.resize(3 + per_row.size());
    for (const std::string& name : model().inputs) run.columns.push_back(name);
    std::vector<double> rise_K(per_row.size());
    double heat = 0.0;
    double rpm = 0.0;
    for (int row = 0; row < 700; ++row) {
      if (row % 50 == 20) rpm = 1500.0 * speed(random);
      double moved_um = heat_um * heat + noise(random);
      for (std::size_t i = 0; i < per_row.size(); ++i) {
        rise_K[i] += (rpm / 500.0 - rise_K[i]) * per_row[i];
        run.values[3 + i].push_back(20.0 + rise_K[i]);
        moved_um += um_per_K[i] * factor[i] * rise_K[i];
      }
      run.values[0].push_back(60.0 * row);
      run.values[1].push_back(rpm);
      run.values[2].push_back(moved_um);
      heat += (rpm * rpm / 4500.0 / 4500.0 - heat) / 100.0;
    }
    run.selected_end = run.rows();
    return run;
  }

  [[nodiscard]] ThermalModel model() const {
    ThermalModel model;
    for (std::size_t i = 1; i <= per_row.size(); ++i)
      model.inputs.push_back(std::string("t").append(std::to_string(i)).append("_degC"));
    model.outputs = {"z_um"};
    model.matrix_um_per_K = {um_per_K};
    return model;
  }
};

/// With a position that goes to and fro in 23 minutes; the first reading's effect grows along it.
RunFile along_axis(const MeasuredMachine& machine, unsigned seed, double um_per_K_mm) {
  RunFile run = machine.run(seed);
  run.columns.emplace_back("x_mm");
  run.values.emplace_back();
  for (std::size_t row = 0; row < run.rows(); ++row) {
    const double x_mm = 20.0 * static_cast<double>(row % 23);
    run.values.back().push_back(x_mm);
    run.values[2][row] += um_per_K_mm * x_mm * (run.values[3][row] - 20.0);
  }
  // Without the speed, whose heat would be as good a name.
  run.columns.erase(run.columns.begin() + 1);
  run.values.erase(run.values.begin() + 1);
  return run;
}

Diagnosis diagnosis_along_axis(const MeasuredMachine& machine, double um_per_K_mm) {
  return diagnose(machine.model(),
                  {along_axis(machine, 1, um_per_K_mm), along_axis(machine, 2, um_per_K_mm)},
                  {along_axis(machine, 3, um_per_K_mm)});
}

/// With a room that swings by 2 K; the body that the speed heats follows it in the same 100 min.
RunFile in_a_room(const MeasuredMachine& machine, unsigned seed, double um_per_K) {
  RunFile run = machine.run(seed);
  run.columns.emplace_back("room_degC");
  run.values.emplace_back();
  double body_K = 0.0;
  for (std::size_t row = 0; row < run.rows(); ++row) {
    const double room_K = 2.0 * std::sin(0.015 * static_cast<double>(row + 300 * seed));
    run.values.back().push_back(20.0 + room_K);
    if (row == 0) body_K = room_K;
    run.values[2][row] += um_per_K * body_K;
    body_K += (room_K - body_K) / 100.0;
  }
  return run;
}

Diagnosis diagnosis_in_a_room(const MeasuredMachine& machine, double um_per_K) {
  return diagnose(machine.model(),
                  {in_a_room(machine, 1, um_per_K), in_a_room(machine, 2, um_per_K)},
                  {in_a_room(machine, 3, um_per_K)});
}

/// A machine of six readings, which are more alike than the causes that they are to be told from.
MeasuredMachine six_readings(std::vector<double> factor) {
  return {{0.1, 0.05, 0.035, 0.025, 0.015, 0.01},
          {9.0, -12.0, 10.0, 7.0, -8.0, 5.0},
          std::move(factor)};
}

Diagnosis diagnosis_of_machine(const MeasuredMachine& machine) {
  return diagnose(machine.model(), {machine.run(1), machine.run(2)}, {machine.run(3)});
}

/// Thirty readings of one output, of which one has an error from the 300th row of the first run on.
/// The displacement shows an error, not of which reading it is.
template <class Error>
Diagnosis diagnosis_of_false_reading(std::size_t sensor, Error error_K) {
  MeasuredMachine machine;
  for (int i = 0; i < 30; ++i) {
    machine.per_row.push_back(0.01 + 0.003 * i);
    machine.um_per_K.push_back((i % 2 == 0 ? 1.0 : -1.0) * (1.0 + 0.37 * (i * 7 % 10)));
    machine.factor.push_back(1.0);
  }
  RunFile train = machine.run(1);
  std::vector<double>& reading = train.values[3 + sensor];
  for (std::size_t row = 300; row < reading.size(); ++row)
    reading[row] += error_K(static_cast<double>(row - 300));
  return diagnose(machine.model(), {train}, {machine.run(2)});
}

}  // namespace

TEST_CASE("growth with the squared speed is named, with its size and its gain", "[diagnosis]") {
  const Diagnosis answer = diagnosis_of([](double rpm, double, int) { return 4e-7 * rpm * rpm; });
  REQUIRE(answer.verdict == "effect");
  REQUIRE(answer.findings.size() == 1);
  const NamedFinding& finding = answer.findings.front();
  CHECK(finding.cause == "speed_growth");
  CHECK(finding.subject == "spindle_rpm");
  REQUIRE(finding.parameters.size() == 1);
  CHECK(finding.parameters[0].values.at("z_um") == Approx(4e-7).epsilon(0.02));
  CHECK(finding.parameters[0].ci95.at("z_um").low < 4e-7);
  CHECK(finding.parameters[0].ci95.at("z_um").high > 4e-7);
  CHECK(finding.test.at("z_um").after_um < 0.2);
  CHECK(finding.test.at("z_um").ci95.low > 0.8);
  CHECK(answer.extended.terms.size() == 1);
  // Its coefficients are fitted anew beside it.
  CHECK(answer.outputs.at("z_um").extended_test_rms_um ==
        Approx(finding.test.at("z_um").after_um).epsilon(0.05));
  // What was found is a model file.
  CHECK_NOTHROW(parse_model(write_model(answer.extended), "extended"));
}

TEST_CASE("the interval of a rarely sampled period covers the true period", "[diagnosis]") {
  const double period_s = 1500.0;
  const auto hidden = [&](double, double, int row) {
    return 8.0 * std::sin(2.0 * std::numbers::pi * 60.0 * row / period_s);
  };
  const auto probed = [&](int each) {
    RunFile run = run_with(1, 1800, hidden);
    for (std::size_t row = 0; row < run.values[3].size(); ++row)
      if (row % static_cast<std::size_t>(each) != 0) run.values[3][row] = NAN;
    return run;
  };
  const int each = GENERATE(1, 30);
  CAPTURE(each);
  const RunFile test = run_with(2, 400, hidden);
  const Diagnosis answer = diagnose(one_input(), {probed(each)}, {test});
  REQUIRE_FALSE(answer.findings.empty());
  REQUIRE(answer.findings[0].cause == "periodic_disturbance");
  const Interval period = answer.findings[0].parameters.front().ci95.at("");
  CHECK(period.low <= period_s);
  CHECK(period.high >= period_s);
  if (each == 1) CHECK(period.high - period.low < 0.1 * period_s);
}

TEST_CASE("readings identify the faulty one of many sensors of one output", "[diagnosis]") {
  const std::size_t sensor = GENERATE(4U, 15U, 22U, 29U);
  CAPTURE(sensor);
  SECTION("it jumps") {
    const Diagnosis answer = diagnosis_of_false_reading(sensor, [](double) { return 3.0; });
    REQUIRE_FALSE(answer.findings.empty());
    CHECK(answer.findings[0].cause == "sensor_step");
    CHECK(answer.findings[0].subject ==
          std::string("t").append(std::to_string(sensor + 1)).append("_degC"));
  }
  SECTION("it drifts") {
    const Diagnosis answer =
        diagnosis_of_false_reading(sensor, [](double row) { return 0.02 * row; });
    REQUIRE_FALSE(answer.findings.empty());
    CHECK(answer.findings[0].cause == "sensor_drift");
    CHECK(answer.findings[0].subject ==
          std::string("t").append(std::to_string(sensor + 1)).append("_degC"));
  }
}

TEST_CASE("a gain's interval includes a fifth of the gain, that of a jump does not",
          "[diagnosis]") {
  const FoundGain wrong = found_gain([](double, double rise_K, int) { return 1.0 * rise_K; });
  CHECK(wrong.value == Approx(1.0).margin(0.1));
  CHECK(wrong.reach == Approx(1.96 * std::hypot(2.0 * wrong.sd, 0.2 * wrong.value)));
  const FoundGain jump = found_gain([](double, double, int row) { return row < 300 ? 0.0 : 4.0; });
  CHECK(jump.reach < 0.2 * jump.value);
}

TEST_CASE("a jump of the datum in one run is a fault of that run and no term", "[diagnosis]") {
  RunFile train = run_with(1, 600, [](double, double, int row) { return row >= 300 ? 8.0 : 0.0; });
  train.argument = "train.csv@0:";
  const RunFile test = run_with(2, 400, [](double, double, int) { return 0.0; });
  const Diagnosis answer = diagnose(one_input(), {train}, {test});
  REQUIRE(answer.findings.size() == 1);
  CHECK(answer.findings[0].cause == "displacement_step");
  CHECK(answer.findings[0].run == "train.csv@0:");
  CHECK(answer.findings[0].test.empty());
  CHECK(answer.extended.terms.empty());
}

TEST_CASE("a cause is found with its size despite small errors of all coefficients",
          "[diagnosis]") {
  MeasuredMachine machine{
      {0.2, 0.05, 0.02, 0.01}, {9.0, -12.0, 10.0, 7.0}, {1.03, 0.96, 1.02, 0.97}};
  machine.heat_um = 30.0;
  const Diagnosis effect = diagnosis_of_machine(machine);
  REQUIRE(effect.findings.size() == 1);
  CHECK(effect.findings[0].cause == "missing_heat_source");
  CHECK(effect.findings[0].parameters.at(0).values.at("") == Approx(6000.0).epsilon(0.2));
}

TEST_CASE("a body heated by a signal also follows the room", "[diagnosis]") {
  MeasuredMachine machine{{0.05, 0.02}, {9.0, -12.0}, {1.0, 1.0}};
  machine.heat_um = 30.0;
  const Diagnosis effect = diagnosis_in_a_room(machine, 5.0);
  REQUIRE(effect.findings.size() == 1);
  CHECK(effect.findings[0].cause == "missing_heat_source");
  CHECK(parameter(effect.findings[0], "gain_um_per_K").values.at("z_um") ==
        Approx(5.0).epsilon(0.2));
  REQUIRE(effect.extended.terms.size() >= 2);
  CHECK(effect.extended.terms[1].kind == "missing_temperature");
  const OutputFigures& z = effect.outputs.at("z_um");
  CHECK(z.extended_test_rms_um < 0.1 * z.test_rms_um);

  const Diagnosis alone = diagnosis_in_a_room(machine, 0.0);
  REQUIRE(alone.findings.size() == 1);
  CHECK(alone.findings[0].cause == "missing_heat_source");
  CHECK(alone.findings[0].parameters.size() == 3);  // nothing of the room
}

TEST_CASE("a cause that coefficient errors could largely explain is the first candidate",
          "[diagnosis]") {
  MeasuredMachine machine = six_readings({0.99, 1.007, 0.981, 0.993, 1.007, 0.986});
  machine.heat_um = 12.0;
  const Diagnosis effect = diagnosis_of_machine(machine);
  CHECK(effect.verdict != "none");
  CHECK(effect.weighed[0].cause == "missing_heat_source");
  CHECK(effect.weighed[0].subject == "spindle_rpm");
  CHECK(effect.weighed[0].probability > 10.0 * effect.weighed[1].probability);
}

TEST_CASE("a small cause beside coefficient errors is left to them or named correctly",
          "[diagnosis]") {
  MeasuredMachine machine = six_readings({0.989, 0.993, 1.001, 0.982, 1.002, 0.992});
  machine.heat_um = 3.0;
  const Diagnosis answer = diagnosis_of_machine(machine);
  for (const NamedFinding& finding : answer.findings) {
    CHECK(finding.cause == "missing_heat_source");
    CHECK(finding.subject == "spindle_rpm");
  }
}

TEST_CASE("position dependence gets no weight if a wrong coefficient explains as much",
          "[diagnosis]") {
  const auto weighed = [](const Diagnosis& answer, const std::string& cause) {
    return std::any_of(answer.weighed.begin(), answer.weighed.end(), [&](const Candidate& each) {
      return each.cause == cause && each.subject.starts_with("t1_degC") && each.probability > 0.2;
    });
  };
  MeasuredMachine machine{{0.05, 0.02}, {9.0, -12.0}, {1.0, 1.0}};
  const Diagnosis along = diagnosis_along_axis(machine, 0.02);
  REQUIRE(along.findings.size() == 1);
  CHECK(along.findings[0].cause == "position_dependence");
  CHECK(along.findings[0].subject == "t1_degC|x_mm");
  machine.factor[0] = 1.5;
  const Diagnosis wrong = diagnosis_along_axis(machine, 0.0);
  REQUIRE(wrong.findings.size() == 1);
  CHECK(wrong.findings[0].cause == "wrong_coefficient");
  CHECK(wrong.findings[0].subject == "t1_degC");
  CHECK(weighed(wrong, "wrong_coefficient"));
  CHECK_FALSE(weighed(wrong, "position_dependence"));
}

TEST_CASE(
    "a matrix counts as fitted to the rows only if a fit of its inputs leaves as much of them",
    "[diagnosis]") {
  MeasuredMachine machine{{0.05, 0.02}, {9.0, -12.0}, {1.0, 1.0}};
  machine.heat_um = 30.0;
  const std::vector<RunFile> runs = {machine.run(1), machine.run(2)};
  const auto fitted = [&](const ThermalModel& model) {
    const MeasuredData data = measured_data(model, runs, shared_columns(model, runs));
    const std::vector<Hypothesis> all = hypotheses(data);
    const SearchResult result = search(data, all);
    CHECK_FALSE(result.findings.empty());
    CHECK(result.unexplained_share[0] < 0.1);  // the coefficients fitted anew beside the finding
    return result.fitted;
  };
  ThermalModel model = machine.model();
  CHECK(fitted(model) == std::vector<bool>{false});
  const MeasuredData data = measured_data(model, runs, shared_columns(model, runs));
  const Panel readings = stacked(data, [](const MeasuredRun& run) -> Panel {
    Panel both(run.rows(), 2);
    both << run.temps_K[0], run.temps_K[1];
    return both;
  });
  const Column moved = stacked(data, [](const MeasuredRun& run) { return run.measured_um[0]; });
  const Eigen::VectorXd fit = readings.colPivHouseholderQr().solve(moved);
  model.matrix_um_per_K = {{fit[0], fit[1]}};
  CHECK(fitted(model) == std::vector<bool>{true});
}

TEST_CASE("the report shows temperatures of findings beside those of the model", "[diagnosis]") {
  const MeasuredMachine machine{{0.05, 0.02, 0.01}, {9.0, -12.0, 10.0}, {1.0, 1.0, 1.0}};
  ThermalModel model = machine.model();
  model.inputs = {"t1_degC", "t3_degC"};
  model.matrix_um_per_K = {{9.0, 10.0}};
  // The second place moves by itself, not with the speed.
  const auto run_of = [&](unsigned seed) {
    RunFile run = machine.run(seed);
    for (std::size_t row = 0; row < run.rows(); ++row) {
      const double rise_K = 3.0 * std::sin(static_cast<double>(row) / 37.0);
      run.values[2][row] += machine.um_per_K[1] * (20.0 + rise_K - run.values[4][row]);
      run.values[4][row] = 20.0 + rise_K;
    }
    return run;
  };
  ReportData report;
  const Diagnosis answer = diagnose(model, {run_of(1), run_of(2)}, {run_of(3)}, &report);
  REQUIRE(answer.findings.size() == 1);
  CHECK(answer.findings[0].cause == "missing_temperature");
  CHECK(answer.findings[0].subject == "t2_degC");
  CHECK(report.inputs == std::vector<std::string>{"t1_degC", "t3_degC", "t2_degC"});
  for (const ReportRun& run : report.runs) CHECK(run.inputs_K.size() == 3);
}

TEST_CASE("an undisturbed machine has no finding", "[diagnosis]") {
  const Diagnosis answer = diagnosis_of([](double, double, int) { return 0.0; });
  CHECK(answer.verdict == "none");
  CHECK(answer.findings.empty());
  CHECK(answer.outputs.at("z_um").test_rms_um == answer.outputs.at("z_um").extended_test_rms_um);
}

TEST_CASE("test runs change no finding and no parameter", "[diagnosis]") {
  const auto hidden = [](double rpm, double, int) { return 4e-7 * rpm * rpm; };
  const RunFile train = run_with(1, 600, hidden);
  const RunFile same = run_with(2, 400, hidden);
  const RunFile other = run_with(3, 200, [](double, double, int row) { return 0.3 * row; });
  const Diagnosis a = diagnose(one_input(), {train}, {same});
  const Diagnosis b = diagnose(one_input(), {train}, {other});
  REQUIRE(a.findings.size() == b.findings.size());
  CHECK(write_model(a.extended) == write_model(b.extended));
}

TEST_CASE("an output keeps coefficients whose correction leaves it worse on the test runs",
          "[diagnosis]") {
  const auto jump_and_error = [](double, double rise_K, int row) {
    return (row >= 300 ? 20.0 : 0.0) + 0.1 * rise_K;
  };
  const RunFile test = run_with(2, 400, [](double, double, int) { return 0.0; });
  const Diagnosis answer = diagnose(one_input(), {run_with(1, 600, jump_and_error)}, {test});
  REQUIRE(answer.findings.size() == 1);
  CHECK(answer.findings[0].cause == "displacement_step");
  CHECK(answer.extended.matrix_um_per_K == one_input().matrix_um_per_K);

  const Diagnosis borne_out = diagnosis_of(jump_and_error);
  CHECK(borne_out.extended.matrix_um_per_K[0][0] == Approx(5.1).epsilon(0.005));
}

TEST_CASE("a displacement of reversed sign is a warning before any cause", "[diagnosis]") {
  const auto reversed = [](unsigned seed) {
    RunFile run = run_with(seed, 600, [](double, double, int) { return 0.0; });
    for (double& each : run.values[3]) each = -each;
    return run;
  };
  const Diagnosis answer = diagnose(one_input(), {reversed(1)}, {reversed(2)});
  REQUIRE(answer.warnings.size() == 1);
  CHECK(answer.warnings[0].find("z_um: measured is -1.0") == 0);
}

TEST_CASE("an effect of a recorded place is named whatever its sign", "[diagnosis]") {
  for (const double lacks_um_per_K : {-1.5, 1.5}) {
    CAPTURE(lacks_um_per_K);
    const Diagnosis answer =
        diagnosis_of([&](double, double rise_K, int) { return lacks_um_per_K * rise_K; });
    REQUIRE_FALSE(answer.findings.empty());
    // The place warms as a low pass of the speed, so the two cannot be told apart.
    const std::string& cause = answer.findings[0].cause;
    CHECK((cause == "wrong_coefficient" || cause == "missing_heat_source"));
    CHECK(answer.outputs.at("z_um").extended_test_rms_um <
          0.2 * answer.outputs.at("z_um").test_rms_um);
    CHECK(answer.warnings.empty());
  }
}

TEST_CASE("few values do not make a cycle", "[diagnosis]") {
  std::mt19937 random(3);
  for (unsigned seed = 1; seed < 9; ++seed) {
    std::vector<RunFile> runs;
    for (unsigned i = 0; i < 2; ++i) {
      RunFile run = run_with(2 * seed + i, 900, [](double, double, int) { return 0.0; });
      for (std::size_t row = 0; row < run.rows(); ++row)
        if (std::uniform_int_distribution<int>(0, 59)(random) != 0) run.values[3][row] = NAN;
      runs.push_back(std::move(run));
    }
    const RunFile test = run_with(99, 400, [](double, double, int) { return 0.0; });
    for (const NamedFinding& finding : diagnose(one_input(), runs, {test}).findings)
      CHECK(finding.cause != "periodic_disturbance");
  }
}

TEST_CASE("missing values are left out, and a run without any is refused", "[diagnosis]") {
  RunFile train = run_with(1, 600, [](double rpm, double, int) { return 4e-7 * rpm * rpm; });
  for (std::size_t row = 0; row < train.rows(); row += 3) train.values[3][row] = NAN;
  for (std::size_t row = 100; row < 110; ++row) train.values[1][row] = NAN;
  const RunFile test = run_with(2, 400, [](double, double, int) { return 0.0; });
  const Diagnosis answer = diagnose(one_input(), {train}, {test});
  REQUIRE_FALSE(answer.findings.empty());
  CHECK(answer.findings[0].cause == "speed_growth");
  train.values[3].assign(train.rows(), NAN);
  CHECK_THROWS_AS(diagnose(one_input(), {train}, {test}), ConfigurationError);
}

TEST_CASE("an output that no run has a value of is left out", "[diagnosis]") {
  ThermalModel model = one_input();
  model.outputs.insert(model.outputs.begin(), "a_um");
  model.matrix_um_per_K.insert(model.matrix_um_per_K.begin(), {3.0});
  const auto hidden = [](double rpm, double, int) { return 4e-7 * rpm * rpm; };
  const Diagnosis answer = diagnose(model, {run_with(1, 600, hidden)}, {run_with(2, 400, hidden)});
  REQUIRE(answer.findings.size() == 1);
  CHECK(answer.findings[0].cause == "speed_growth");
  CHECK(answer.findings[0].outputs == std::vector<std::string>{"z_um"});
}

TEST_CASE("the likeliest candidates stand in the JSON, all of them where they are asked for",
          "[diagnosis]") {
  const Diagnosis answer = diagnosis_of([](double rpm, double, int) { return 4e-7 * rpm * rpm; });
  REQUIRE(answer.weighed.size() > 3);
  CHECK(answer.weighed[0].cause == "speed_growth");
  CHECK_FALSE(answer.weighed[0].would_decide.empty());
  CHECK(answer.weighed[0].test.at("z_um").reduction > 0.8);
  double sum = 0.0;
  for (const auto& [family, probability] : answer.families) sum += probability;
  CHECK(sum == Approx(1.0));
  const auto count = [](const std::string& json) {
    std::size_t found = 0;
    for (std::size_t at = 0; (at = json.find("\"would_decide\"", at)) != std::string::npos; ++at)
      ++found;
    return found;
  };
  CHECK(count(diagnosis_json(answer)) == 3);
  CHECK(count(diagnosis_json(answer, true)) == answer.weighed.size());
}

TEST_CASE("the JSON has the documented keys", "[diagnosis]") {
  const std::string json =
      diagnosis_json(diagnosis_of([](double rpm, double, int) { return 4e-7 * rpm * rpm; }));
  for (const char* key :
       {"\"verdict\": \"effect\"", "\"baseline\"", "\"train_rms_um\"", "\"findings\"",
        "\"parameters_ci95\"", "\"alternatives\"", "\"test_rms_um\"", "\"reduction\"",
        "\"extended\"", "\"unexplained_fraction\"", "\"probability\"", "\"family\": \"heat\"",
        "\"family_probability\"", "\"group\"", "\"headroom\"", "\"not_recorded\"", "\"families\""})
    CHECK_THAT(json, Catch::Contains(key));
}

TEST_CASE("a coefficient that depends on how the day began is named (C1)", "[diagnosis]") {
  // [5 + 0.25 (T0 - 19)] dT: 4.25 um/K on the day that begins at 16 degC, 6.5 at 25 degC.
  const Diagnosis diagnosis = diagnosis_of_days(
      [](double start_degC, double rise_K, double) { return 0.25 * (start_degC - 19.0) * rise_K; });
  REQUIRE_FALSE(diagnosis.findings.empty());
  const NamedFinding& finding = diagnosis.findings.front();
  CHECK(finding.cause == "start_dependence");
  CHECK(finding.subject == "t1_degC|t1_degC");
  CHECK(parameter(finding, "gain_um_per_unit_K").values.at("z_um") == Approx(0.25).epsilon(0.05));
  CHECK(parameter(finding, "place0_degC").values.at("") == Approx(19.0).margin(0.3));
  const TestGain& gain = finding.test.at("z_um");
  CHECK(gain.after_um < 0.3 * gain.before_um);
}

TEST_CASE("a running-in that depends on how the day began is named (C2)", "[diagnosis]") {
  // N b2 (T0 - 14) {1 - exp(ln 0.1 t / 30 min)} with b2 = 0.0004: 3.6 um at 4500 rpm from 16 degC.
  const Diagnosis diagnosis = diagnosis_of_days([](double start_degC, double, double late_rpm) {
    return 0.0004 * (start_degC - 14.0) * late_rpm;
  });
  REQUIRE_FALSE(diagnosis.findings.empty());
  const NamedFinding& finding = diagnosis.findings.front();
  CHECK(finding.cause == "start_dependence");
  CHECK(finding.subject == "spindle_rpm|t1_degC");
  CHECK(parameter(finding, "gain_um_per_unit_K").values.at("z_um") == Approx(0.0004).epsilon(0.1));
  CHECK(parameter(finding, "place0_degC").values.at("") == Approx(14.0).margin(0.5));
  const Interval tau_s = parameter(finding, "tau_s").ci95.at("");
  CHECK(tau_s.low < 781.7);
  CHECK(tau_s.high > 781.7);
  CHECK(tau_s.high < 2.0 * tau_s.low);
}
