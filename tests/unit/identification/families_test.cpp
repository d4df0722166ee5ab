#include "modelling/identification/families/families.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>

#include <catch2/catch.hpp>

#include "config/model/model_file.hpp"
#include "estimator/model/displacement_model.hpp"
#include "machine_runs.hpp"
#include "modelling/identification/families/bank_fit.hpp"

using namespace thermocomp;
using namespace thermocomp::identification;

namespace {

const FamilyResult& result_of(const FamiliesFit& fit, Family family) {
  return fit.results[static_cast<std::size_t>(family)];
}

}  // namespace

TEST_CASE("a machine of two static places gets their gains, and small lags", "[families]") {
  const MeasuredTests tests = machine_tests(
      4, [](double quick, double slow, double, double) { return 5.0 * quick - 3.0 * slow; });
  const FamiliesFit fit = fitted(tests);
  CHECK(fit.chosen == Family::lag_bank);
  CHECK(fit.of_model.left_out_rms_um[0] < 0.6);
  CHECK(fit.model.matrix_um_per_K[0][0] == Approx(5.0).epsilon(0.02));
  CHECK(fit.model.matrix_um_per_K[0][1] == Approx(-3.0).epsilon(0.1));
}

TEST_CASE("few sensors are chosen if they leave a tenth less than the bank", "[families]") {
  const MeasuredTests tests =
      machine_tests(4, [](double, double slow, double, double) { return -3.0 * slow; });
  const FamiliesFit fit = fitted(tests);
  CHECK(fit.chosen == Family::static_few);
  CHECK(fit.few.has_value());
  CHECK(result_of(fit, Family::static_few).left_out_rms_um[0] <
        0.9 * result_of(fit, Family::lag_bank).left_out_rms_um[0]);
}

TEST_CASE("delayed displacement gets no static model", "[families]") {
  const MeasuredTests tests = machine_tests(
      4, [](double, double, double late, double rpm) { return 6.0 * late + 4e-3 * rpm; });
  const FamiliesFit fit = fitted(tests);
  CHECK(fit.chosen >= Family::lagged_few);
  CHECK(fit.of_model.left_out_rms_um[0] <
        0.6 * result_of(fit, Family::static_few).left_out_rms_um[0]);
}

TEST_CASE("displacement independent of all recorded columns gets no model", "[families]") {
  std::mt19937_64 engine(5);
  for (const double stays : {0.0, 0.9}) {  // correlation of successive rows' noise
    CAPTURE(stays);
    double noise_um = 0.0;
    const MeasuredTests tests = machine_tests(4, [&](double, double, double, double) {
      return noise_um = stays * noise_um + 3.0 * gaussian(engine);
    });
    const FamiliesFit fit = fitted(tests);
    CHECK(fit.chosen == Family::none);
    CHECK(fit.model.matrix_um_per_K[0][0] == 0.0);
    CHECK(families_text(tests, fit).find("no family is better than no model") != std::string::npos);
  }
}

TEST_CASE("a model that leaves half or more is reported as unfit for use", "[families]") {
  std::mt19937_64 engine(5);
  for (const double noise_um : {0.5, 4.0}) {
    const MeasuredTests tests = machine_tests(4, [&](double quick, double, double, double) {
      return quick + noise_um * gaussian(engine);
    });
    const FamiliesFit fit = fitted(tests, Family::static_few);
    const std::string message = families_text(tests, fit);
    const std::string page = families_html(tests, fit);
    const double share = fit.of_model.left_out_rms_um[0] / fit.results.front().left_out_rms_um[0];
    CAPTURE(noise_um, share);
    CHECK((share >= 0.5) == (noise_um > 1.0));
    CHECK((message.find("Next: thermocomp diagnose") != std::string::npos) == (share >= 0.5));
    CHECK((page.find("not fit for use. Next: thermocomp diagnose") != std::string::npos) ==
          (share >= 0.5));
    std::array<char, 20> printed_share{};  // of the RMS, not of its square
    std::snprintf(printed_share.data(), printed_share.size(), " %.1f %%\n", 100.0 * share);
    CHECK(message.find(printed_share.data()) != std::string::npos);
  }
}

TEST_CASE("for two different runs the family is chosen by stretches of both", "[families]") {
  // The second run's speed is ten times the first one's: neither predicts the other.
  const auto moved = [](double quick, double slow, double, double rpm) {
    return 5.0 * quick - 3.0 * slow + 1e-6 * rpm * rpm;
  };
  RunFile slow = machine_run("slow", 4, moved);
  RunFile fast = machine_run("fast", 3, moved);
  for (double& rpm : slow.values[3]) rpm *= 0.1;
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  const MeasuredTests tests = measured_tests({slow, fast}, options);
  const FamiliesFit fit = fitted(tests);
  CHECK(fit.chosen != Family::none);
  CHECK(fit.results.front().fold_um[0].size() == 2);  // figures are of whole runs
  CHECK(families_text(tests, fit).find("um of left-out data (geometric mean") != std::string::npos);
}

TEST_CASE("one temperature is enough for a model", "[families]") {
  RunFile run = machine_run("one", 3, [](double quick, double, double, double) { return quick; });
  run.columns = {"time_s", "t1_degC", "spindle_rpm", "z_um"};
  run.values.erase(run.values.begin() + 2);
  TestOptions options;
  options.outputs = {"z_um"};
  options.folds_of_one_run = 8;
  const FamiliesFit fit = fitted(measured_tests({run}, options));
  CHECK(fit.chosen != Family::none);
  CHECK(result_of(fit, Family::physical).answers == false);
  CHECK(fit.model.made_from->within_one_run);
}

TEST_CASE("a model judged within one run has a warning", "[families]") {
  const MeasuredTests tests = machine_tests(
      1, [](double quick, double slow, double, double) { return 5.0 * quick - 3.0 * slow; });
  const FamiliesFit fit = fitted(tests);
  const std::string message = families_text(tests, fit);
  CHECK(message.find("judged within one run: the error on other days is unknown") !=
        std::string::npos);
  CHECK(message.find("Next: a run of another day") != std::string::npos);
  CHECK(message.find("on another day (each half of this run by a model of the other)") !=
        std::string::npos);
}

TEST_CASE("an output that cannot be predicted gets no gains, and the others keep theirs",
          "[families]") {
  std::mt19937_64 engine(7);
  std::vector<RunFile> files;
  for (std::size_t i = 0; i < 3; ++i) {
    RunFile& run = files.emplace_back(machine_run(
        std::string("run").append(std::to_string(i)), i + 1,
        [](double quick, double slow, double, double) { return 5.0 * quick - 3.0 * slow; }));
    run.columns.emplace_back("x_um");
    std::vector<double>& noise_um = run.values.emplace_back();
    for (std::size_t row = 0; row < run.values[0].size(); ++row)
      noise_um.push_back(20.0 * gaussian(engine));
  }
  TestOptions options;
  options.outputs = {"x_um", "z_um"};
  const FamiliesFit fit = fitted(measured_tests(files, options));
  CHECK(fit.chosen != Family::none);
  CHECK(fit.without_gains == std::vector<std::size_t>{0});
  CHECK_FALSE(has_gain(fit.model, "x_um"));
  CHECK(has_gain(fit.model, "z_um"));
  CHECK(fit.of_model.left_out_rms_um[0] == fit.results[0].left_out_rms_um[0]);
  CHECK(fit.of_model.left_out_rms_um[1] < 0.1 * fit.results[0].left_out_rms_um[1]);
  CHECK(fit.model.made_from->outputs.at("x_um").left_out_rms_um > 15.0);
}

TEST_CASE("fit prints one expected error per output, and its basis", "[families]") {
  const auto follows = [](double quick, double slow, double, double) { return 5.0 * quick - slow; };
  const MeasuredTests two = machine_tests(2, follows);
  const std::string message = families_text(two, fitted(two));
  CHECK(message.find("um RMS on a third run (each run by a model of the other alone)") !=
        std::string::npos);
  const MeasuredTests three = machine_tests(3, follows);
  CHECK(families_text(three, fitted(three)).find("um RMS on another run (runs left out)") !=
        std::string::npos);
}

TEST_CASE("few runs increase the uncertainty of a prediction", "[families]") {
  MadeFrom made_from;
  made_from.runs = {"a.csv"};
  MadeFrom::Output output;
  output.left_out_rms_um = 4.0;
  output.no_model_rms_um = 12.0;
  CHECK(spread_um(made_from, output, false) == Approx(5.0));
  made_from.runs.resize(16);
  CHECK(spread_um(made_from, output, true) == Approx(5.0));
  CHECK(spread_um(made_from, output, false) == Approx(std::hypot(4.0, 1.5)));
  output.no_model_rms_um = 0.0;  // not stated
  CHECK(spread_um(made_from, output, false) == 4.0);
}

TEST_CASE("a bank of lags is written, read back and predicts as judged", "[families]") {
  const MeasuredTests tests = machine_tests(
      3, [](double, double, double late, double rpm) { return 6.0 * late + 4e-3 * rpm; });
  const FamiliesFit fit = fitted(tests, Family::lag_bank);
  REQUIRE(fit.model.terms.size() == 1);
  CHECK(fit.model.terms[0].kind == "lag_bank");
  const ThermalModel back = parse_model(write_model(fit.model), "written");
  CHECK(back.made_from == fit.model.made_from);
  CHECK(back.terms[0].bank == fit.model.terms[0].bank);
  // The remainder in [made_from] comes from the daemon's own model.
  const MadeFrom::Output& output = back.made_from->outputs.at("z_um");
  CHECK(output.remainder_rms_um < 0.5);
  CHECK(output.left_out_rms_um < 0.8);
  CHECK(output.no_model_rms_um > 5.0);
}

TEST_CASE("a model's own rows are inside its domain, a hotter day is not", "[families]") {
  const MeasuredTests tests = machine_tests(
      3, [](double quick, double slow, double, double) { return 5.0 * quick - 3.0 * slow; });
  const ThermalModel model = fitted(tests).model;
  ModelDomain domain(model);
  const std::size_t inputs = model.temperature_columns().size();
  const std::vector<double> signals(model.signal_columns().size(), 0.0);
  std::vector<double> temps(inputs);
  std::vector<double> reference(inputs);
  const auto look = [&](double warmer_K) {
    domain.restart();
    bool outside = false;
    const TestRun& run = tests.runs[0];
    for (Eigen::Index row = 0; row < run.time_s.size(); ++row) {
      for (std::size_t i = 0; i < inputs; ++i) {
        const auto place = std::find(tests.places.begin(), tests.places.end(), model.inputs[i]);
        const auto at = place - tests.places.begin();
        reference[i] = run.reference_degC[at] + warmer_K;
        temps[i] = reference[i] + run.places_K(row, at);
      }
      domain.step(std::chrono::seconds(static_cast<long>(run.time_s[row])), temps, reference,
                  signals);
      outside = outside || domain.outside();
    }
    return outside;
  };
  CHECK_FALSE(look(0.0));
  CHECK(look(15.0));
}

TEST_CASE("three readings of 3276.7 degC are left out with a note", "[families]") {
  RunFile run =
      machine_run("spikes", 3, [](double quick, double, double, double) { return quick; });
  for (const std::size_t row : {50u, 140u, 200u}) run.values[1][row] = 3276.7;
  TestOptions options;
  options.outputs = {"z_um"};
  const MeasuredTests tests = measured_tests({run}, options);
  REQUIRE_FALSE(tests.notes.empty());
  CHECK(tests.notes[0].find("t1_degC: 3 readings are left out") != std::string::npos);
  CHECK(tests.runs[0].places_K.maxCoeff() < 50.0);
}

TEST_CASE("the domain contains the states between two probings", "[families]") {
  RunFile run =
      machine_run("probed", 3, [](double quick, double, double, double) { return 5.0 * quick; });
  for (std::size_t row = 0; row < run.rows(); ++row)
    if (row % 30 != 0) run.values[4][row] = std::nan("");
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  const FamiliesFit fit = fitted(measured_tests({run}, options));
  const auto& [low, high] = std::minmax_element(run.values[1].begin(), run.values[1].end());
  REQUIRE(fit.model.made_from->columns[0] == "t1_degC");
  CHECK(fit.model.made_from->low[0] == Approx(*low));
  CHECK(fit.model.made_from->high[0] == Approx(*high));
}

TEST_CASE("an open thermocouple is left out, and does not widen the domain", "[families]") {
  const std::size_t last = GENERATE(150u, 360u);  // 360: to the end
  RunFile run = machine_run("open", 3, [](double quick, double, double, double) { return quick; });
  const std::size_t end = std::min(last, run.rows());
  for (std::size_t row = 120; row < end; ++row) run.values[1][row] = 850.0;
  TestOptions options;
  options.outputs = {"z_um"};
  const MeasuredTests tests = measured_tests({run}, options);
  REQUIRE_FALSE(tests.notes.empty());
  CHECK_THAT(tests.notes[0],
             Catch::Contains("t1_degC: " + std::to_string(end - 120) + " readings"));
  CHECK(tests.runs[0].places_K.maxCoeff() < 50.0);
}

TEST_CASE("a heater switched on after the first row is not a spike", "[families]") {
  RunFile run =
      machine_run("heater", 3, [](double quick, double, double, double) { return quick; });
  for (std::size_t row = 0; row < run.rows(); ++row) run.values[2][row] = row == 0 ? 32.0 : 100.0;
  TestOptions options;
  options.outputs = {"z_um"};
  const MeasuredTests tests = measured_tests({run}, options);
  CHECK(tests.notes.empty());
  CHECK(tests.runs[0].reference_degC[1] == 32.0);
  run.values[2][0] = 3276.7;
  CHECK(measured_tests({run}, options).notes.size() == 2);  // ... and the remaining rows never move
}

TEST_CASE("the same rows twice are refused", "[families]") {
  const RunFile run =
      machine_run("run", 3, [](double quick, double, double, double) { return quick; });
  TestOptions options;
  options.outputs = {"z_um"};
  CHECK_THROWS_AS(measured_tests({run, run}, options), ConfigurationError);
}

TEST_CASE("the bank's columns are the low passes of the recorded columns, from 0", "[families]") {
  const MeasuredTests tests =
      machine_tests(1, [](double quick, double, double, double) { return quick; });
  const BankColumns columns = bank_columns(tests);
  CHECK(columns.subjects == std::vector<std::string>{"t1_degC", "t2_degC", "spindle_rpm"});
  CHECK(columns.taus_s == std::vector<double>{0.0, 300.0, 900.0, 2700.0, 8100.0});
  const Eigen::MatrixXd bank = bank_of(tests.course(0), tests, columns, tests.rows_in_course(0));
  CHECK(bank.row(0).norm() == 0.0);
  CHECK(bank.col(0).isApprox(tests.runs[0].places_K.col(0)));
}

TEST_CASE("a bank's low passes see the rows before the first and between two probings",
          "[families]") {
  RunFile run = machine_run("run", 1, [](double, double, double late, double) { return late; });
  TestOptions options;
  options.outputs = {"z_um"};
  const MeasuredTests all = measured_tests({run}, options);
  std::vector<Eigen::Index> probed;
  for (std::size_t row = 0; row < run.values[4].size(); ++row)
    if (row % 30 == 20)
      probed.push_back(static_cast<Eigen::Index>(row));
    else
      run.values[4][row] = not_a_number;
  const MeasuredTests rare = measured_tests({run}, options);
  REQUIRE(rare.rows() == std::ssize(probed));
  CHECK(rare.rows_in_course(0) == probed);
  const BankColumns columns = bank_columns(rare);
  CHECK(columns.taus_s == bank_columns(all).taus_s);
  const Eigen::MatrixXd whole = bank_of(all.course(0), all, columns, all.rows_in_course(0));
  const Eigen::MatrixXd expected = whole(probed, Eigen::all).rowwise() - whole.row(probed[0]);
  CHECK((BankEquations(rare, columns).rows()[0] - expected).norm() < 1e-9 * expected.norm());
}

TEST_CASE("the order of the columns in a file does not change a bank's gains", "[families]") {
  std::vector<MeasuredTests> both;
  for (const bool turned : {false, true}) {
    RunFile run = machine_run("run", 1, [](double quick, double slow, double late, double) {
      return 3.0 * quick + 2.0 * slow + 4.0 * late;
    });
    if (turned) {
      std::swap(run.columns[1], run.columns[2]);
      std::swap(run.values[1], run.values[2]);
    }
    TestOptions options;
    options.outputs = {"z_um"};
    both.push_back(measured_tests({run}, options));
  }
  std::array<Eigen::MatrixXd, 2> gains;  // by time constants of t1 and t2, of t2 and t1
  for (std::size_t i = 0; i < 2; ++i) {
    const BankEquations equations(both[i], bank_columns(both[i]));
    gains[i] = equations.fit(both[i].folds.size()).reshaped(2, Eigen::AutoSize);
  }
  CHECK(gains[0].norm() > 3.0);
  CHECK((gains[0] - gains[1].colwise().reverse()).norm() < 1e-6 * gains[0].norm());
}

TEST_CASE("a bank fits a curved response to a signal", "[families]") {
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  const auto runs = [](std::size_t first, std::size_t count) {
    std::vector<RunFile> files;
    for (std::size_t i = first; i < first + count; ++i) {
      RunFile run = machine_run(std::string("run").append(std::to_string(i)), i + 1,
                                [](double quick, double, double, double) { return quick; });
      run.columns[3] = "x_mm";
      for (std::size_t row = 0; row < run.values[3].size(); ++row) {
        const double x_mm = 250.0 + 250.0 * std::sin(double(i) + double(row) / (9.0 + double(i)));
        run.values[3][row] = x_mm;
        run.values[4][row] += 4.0 * std::sin(x_mm / 60.0);
      }
      files.push_back(std::move(run));
    }
    return files;
  };
  const MeasuredTests tests = measured_tests(runs(0, 3), options);
  BankColumns columns = bank_columns(tests);
  CHECK(columns.hinges.empty());
  const std::size_t late = columns.size();
  add_hinges(tests, columns);
  REQUIRE(columns.size() == late + 8);
  CHECK(columns.hinges.front().above == Approx(500.0 / 9.0).epsilon(0.01));

  const FamiliesFit fit = fitted(tests);
  CHECK(fit.chosen == Family::lag_bank);
  CHECK(fit.of_model.left_out_rms_um[0] < 1.2);  // the curve alone moves by 2.8
  // The hinges are in the model, and carry the curve.
  const auto curve_um = [&](double x_mm) {
    double sum_um = 0.0;
    for (const TermSpec& term : fit.model.terms)
      if (term.kind == "signal_hinge")
        sum_um += term.per_output.at("gain_um_per_unit").at("z_um") *
                  std::max(0.0, x_mm - term.shared.at("above"));
    return sum_um;
  };
  CHECK(curve_um(280.0) - 0.5 * (curve_um(90.0) + curve_um(470.0)) < -4.0);
}

TEST_CASE("a speed of a few steps has no hinges", "[families]") {
  const MeasuredTests tests =
      machine_tests(4, [](double quick, double, double, double) { return quick; });
  BankColumns columns = bank_columns(tests);
  add_hinges(tests, columns);
  CHECK(columns.hinges.empty());
}

TEST_CASE("a signal with a few missing values loses those rows only", "[families]") {
  const auto moved = [](double quick, double, double, double rpm) {
    return 5.0 * quick + 2e-3 * rpm;
  };
  std::vector<RunFile> files{machine_run("a", 1, moved), machine_run("b", 2, moved)};
  files[0].values[3][0] = not_a_number;  // as at the start of a daemon's export
  files[1].values[3][100] = not_a_number;
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  const MeasuredTests tests = measured_tests(files, options);
  CHECK(tests.signals == std::vector<std::string>{"spindle_rpm"});
  CHECK(tests.runs[0].time_s.size() == 60 * hours - 1);
  CHECK(tests.runs[0].time_s[0] == 60.0);
  CHECK(tests.runs[1].time_s.size() == 60 * hours - 1);
  for (const TestRun& run : tests.runs) CHECK(run.signals.allFinite());
}

TEST_CASE("blunders of a probe are left out with a note, including the first row", "[families]") {
  const auto moved = [](double quick, double, double, double) { return 5.0 * quick; };
  RunFile run = machine_run("probe", 3, moved);
  for (const std::size_t row : {0u, 40u, 41u, 200u, 359u}) run.values[4][row] += 4300.0;
  TestOptions options;
  options.outputs = {"z_um"};
  const MeasuredTests tests = measured_tests({run}, options);
  REQUIRE(tests.notes.size() == 1);
  CHECK(tests.notes[0].find("z_um: 5 values are left out") != std::string::npos);
  CHECK(tests.runs[0].time_s[0] == 60.0);
  CHECK(tests.runs[0].outputs_um.cwiseAbs().maxCoeff() < 100.0);
  RunFile stuck = machine_run("stuck", 3, moved);
  for (std::size_t row = 5; row < 45; ++row) stuck.values[4][row] = stuck.values[4][5];
  const MeasuredTests unstuck = measured_tests({stuck}, options);
  REQUIRE(unstuck.notes.size() == 1);
  CHECK(unstuck.notes[0].find("z_um: 39 values are left out, the same from 360 to 2640 s") !=
        std::string::npos);
  RunFile steps = machine_run("steps", 3, moved);  // a step of the machine is not a blunder
  for (std::size_t row = 100; row < steps.rows(); ++row) steps.values[4][row] += 60.0;
  CHECK(measured_tests({steps}, options).notes.empty());
}

TEST_CASE("a family that is worse than no model on a run left out is not chosen", "[families]") {
  // The third run moves in the opposite direction: any two runs predict the other wrongly.
  std::vector<RunFile> files;
  for (std::size_t i = 0; i < 3; ++i) {
    const double gain = i == 2 ? -5.0 : 5.0;
    files.push_back(
        machine_run(std::string("run").append(std::to_string(i)), i + 1,
                    [&](double quick, double, double, double) { return gain * quick; }));
  }
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  const MeasuredTests tests = measured_tests(files, options);
  const FamiliesFit fit = fitted(tests);
  CHECK(fit.chosen == Family::none);
  CHECK(fit.chosen_because.find("lag_bank is worse than no model on ") != std::string::npos);
}

TEST_CASE("the run with most of the error is named with its difference", "[families]") {
  for (const bool one_differs : {false, true}) {
    std::vector<RunFile> files;
    for (std::size_t i = 0; i < 4; ++i)
      files.push_back(
          machine_run(std::string("run").append(std::to_string(i)), i + 1,
                      [](double quick, double, double, double) { return 5.0 * quick; }));
    for (std::size_t row = 0; row < 200 && one_differs; ++row) {
      files[3].values[3][row] = 10000.0;
      if (row > 0) files[3].values[4][row] += 30.0;
    }
    TestOptions options;
    options.outputs = {"z_um"};
    options.signals = true;
    const MeasuredTests tests = measured_tests(files, options);
    const std::string message = families_text(tests, fitted(tests, Family::static_few));
    CAPTURE(message);
    CHECK((message.find("z_um: run3 decides: when it is left out, static_few leaves ") !=
           std::string::npos) == one_differs);
    CHECK((message.find(
               "of the other runs; it starts at spindle_rpm = 10000, the others at 0 to 3500") !=
           std::string::npos) == one_differs);
  }
}

TEST_CASE("two heaters that ran together share the gain", "[families]") {
  // Only the first bends the machine; both heat alike but for the noise of their sensors.
  const auto heaters = [](std::uint64_t seed) {
    std::mt19937_64 engine(seed);
    RunFile run;
    run.name = std::string("run").append(std::to_string(seed));
    run.columns = {"time_s", "bed_degC", "nozzle_degC", "z_um"};
    run.values.resize(4);
    double bed_K = 0.0;
    double nozzle_K = 0.0;
    for (std::size_t minute = 0; minute < 60 * hours; ++minute) {
      const double heat_K = (minute + 31 * seed) % 140 < 80 ? 50.0 : 10.0;
      bed_K += (heat_K - bed_K) / 12.0;
      nozzle_K += (3.0 * heat_K - nozzle_K) / 12.0;
      run.values[0].push_back(60.0 * double(minute));
      run.values[1].push_back(22.0 + bed_K + 0.02 * gaussian(engine));
      run.values[2].push_back(22.0 + nozzle_K + 0.06 * gaussian(engine));
      run.values[3].push_back(4.0 * bed_K + 6.0 * gaussian(engine));
    }
    run.selected_end = run.values[0].size();
    return run;
  };
  TestOptions options;
  options.outputs = {"z_um"};
  const Family family = GENERATE(Family::static_few, Family::lag_bank);
  CAPTURE(to_string(family));
  const FamiliesFit fit = fitted(measured_tests({heaters(1), heaters(2)}, options), family);
  CHECK(fit.together == std::vector<std::vector<std::string>>{{"bed_degC", "nozzle_degC"}});
  // The sum is known: 4 um for each K of the bed, 3 K of the nozzle with it.
  const auto moves_um = [&](double bed_K, double nozzle_K) {
    double sum_um = 0.0;
    for (std::size_t i = 0; i < fit.model.inputs.size(); ++i) {
      double gain = fit.model.matrix_um_per_K[0][i];
      if (!fit.model.terms.empty()) {
        const auto& bank = fit.model.terms[0].bank;
        for (std::size_t j = 0; j < bank.subjects.size(); ++j)
          if (bank.subjects[j] == fit.model.inputs[i])
            for (const double each : bank.gain_um_per_unit.at("z_um")[j]) gain += each;
      }
      sum_um += gain * (fit.model.inputs[i] == "bed_degC" ? bed_K : nozzle_K);
    }
    return sum_um;
  };
  CHECK(moves_um(40.0, 120.0) == Approx(160.0).epsilon(0.1));
  for (const double alone_um : {moves_um(40.0, 0.0), moves_um(0.0, 120.0)}) {
    CHECK(alone_um > 0.0);
    CHECK(alone_um < 160.0);
  }
}

namespace {

/// Days that begin at `starts_degC` of the first place; z = moved(start, rise, speed with 900 s).
template <class Moved>
MeasuredTests days_from(const std::vector<double>& starts_degC, Moved moved) {
  std::vector<RunFile> files;
  for (std::size_t i = 0; i < starts_degC.size(); ++i) {
    RunFile run = machine_run(std::string("day").append(std::to_string(i)), i + 1,
                              [](double, double, double, double) { return 0.0; });
    std::vector<double>& place_degC = run.values[1];
    const double shift_K = starts_degC[i] - place_degC[0];
    double late = run.values[3][0];
    for (std::size_t row = 0; row < place_degC.size(); ++row) {
      place_degC[row] += shift_K;
      if (row > 0) late += (run.values[3][row] - late) * -std::expm1(-60.0 / 900.0);
      run.values[4][row] += moved(starts_degC[i], place_degC[row] - starts_degC[i], late);
    }
    files.push_back(std::move(run));
  }
  TestOptions options;
  options.outputs = {"z_um"};
  options.signals = true;
  return measured_tests(files, options);
}

/// Gain of z at the second temperature from the only term of its kind.
double gain_at(const ThermalModel& model, double temp_degC) {
  const TermSpec* found = nullptr;
  for (const TermSpec& term : model.terms) {
    if (term.kind != "start_dependence") continue;
    REQUIRE(found == nullptr);
    found = &term;
  }
  REQUIRE(found != nullptr);
  return found->per_output.at("gain_um_per_unit_K").at("z_um") *
         (temp_degC - found->shared.at("place0_degC"));
}

}  // namespace

TEST_CASE("a coefficient that depends on the start temperature is fitted (C1)", "[families]") {
  // [5 + 0.25 (T0 - 19)] dT: 5 + 0.25 (16 - 19) = 4.25 and 5 + 0.25 (25 - 19) = 6.5 um/K.
  const MeasuredTests tests =
      days_from({16.0, 20.0, 25.0, 22.0}, [](double start_degC, double rise_K, double) {
        return (5.0 + 0.25 * (start_degC - 19.0)) * rise_K;
      });
  const FamiliesFit fit = fitted(tests, Family::physical);
  const double always_um_per_K = fit.model.matrix_um_per_K[0][0];
  CHECK(always_um_per_K + gain_at(fit.model, 16.0) == Approx(4.25).epsilon(0.02));
  CHECK(always_um_per_K + gain_at(fit.model, 25.0) == Approx(6.5).epsilon(0.02));
  CHECK(fit.of_model.left_out_rms_um[0] <
        0.4 * result_of(fit, Family::static_few).left_out_rms_um[0]);
}

TEST_CASE("a running-in that depends on the start temperature is fitted (C2)", "[families]") {
  // N [b1 + b2 (T0 - 20)] LP(1), b1 = 0.004, b2 = 0.0008: 0.0008 and 0.008 um/rpm from 16 and 25.
  const MeasuredTests tests =
      days_from({16.0, 20.0, 25.0, 22.0}, [](double start_degC, double rise_K, double late_rpm) {
        return 3.0 * rise_K + (0.004 + 0.0008 * (start_degC - 20.0)) * late_rpm;
      });
  const FamiliesFit fit = fitted(tests, Family::physical);
  CHECK(gain_at(fit.model, 25.0) - gain_at(fit.model, 16.0) == Approx(0.0072).epsilon(0.05));
  const auto by_start =
      std::find_if(fit.model.terms.begin(), fit.model.terms.end(),
                   [](const TermSpec& term) { return term.kind == "start_dependence"; });
  CHECK(by_start->subject == "spindle_rpm|t1_degC");
  CHECK(by_start->shared.at("tau_s") == 900.0);
  CHECK(by_start->shared.at("at_start") == 1.0);
}
