// What a model makes of readings that are wrong.
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

/// t1 and t2 move alike, t3 does not; the model has t1 with a lag, and leaves 2 (t3 lagged).
RunFile two_bodies(int rows) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 0.05);
  RunFile run;
  run.name = "run.csv";
  run.columns = {"time_s", "t1_degC", "t2_degC", "t3_degC", "z_um"};
  run.values.resize(5);
  double late_K = 0.0;
  for (int row = 0; row < rows; ++row) {
    const double one_K = 5.0 * std::sin(row / 60.0);
    const double other_K = 4.0 * std::sin(row / 23.0 + 1.0) - 4.0 * std::sin(1.0);
    late_K += (other_K - late_K) * -std::expm1(-60.0 / 900.0);
    run.values[0].push_back(60.0 * row);
    run.values[1].push_back(20.0 + one_K);
    run.values[2].push_back(22.0 + 0.8 * one_K + noise(random));
    run.values[3].push_back(21.0 + other_K);
    run.values[4].push_back(5.0 * one_K + 2.0 * late_K + noise(random));
  }
  run.selected_end = run.rows();
  return run;
}

ThermalModel model_of_one() {
  ThermalModel model;
  model.inputs = {"t1_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{5.0}};
  return model;
}

ThermalModel model_with_lag() {
  ThermalModel model = model_of_one();
  model.terms.push_back(
      {"thermal_lag", "t1_degC", {{"tau_s", 900.0}}, {{"gain_um_per_K", {{"z_um", 2.0}}}}});
  return model;
}

/// t1 settles at 5 um/K, of which 2 are at once; t3 acts late alone.
ThermalModel model_with_bank() {
  ThermalModel model = model_of_one();
  model.inputs = {"t1_degC", "t3_degC"};
  model.matrix_um_per_K = {{2.0, 0.0}};
  TermSpec term;
  term.kind = "lag_bank";
  term.bank.subjects = {"t3_degC", "t1_degC"};
  term.bank.taus_s = {300.0, 900.0};
  term.bank.gain_um_per_unit["z_um"] = {{0.3, 0.6}, {1.0, 2.0}};
  model.terms.push_back(std::move(term));
  return model;
}

MeasuredData data_of(const ThermalModel& model, int rows) {
  const std::vector<RunFile> runs = {two_bodies(rows)};
  return measured_data(model, runs, shared_columns(model, runs));
}

}  // namespace

TEST_CASE("an error of a reading acts through every term as in the prediction", "[diagnosis]") {
  const auto [name, model] = GENERATE(values<std::pair<const char*, ThermalModel>>(
      {{"lag", model_with_lag()}, {"bank of lags", model_with_bank()}}));
  INFO(name);
  const MeasuredData data = data_of(model, 300);
  const MeasuredRun& run = data.runs.front();
  Panel errors_K = Panel::Zero(run.rows(), 2);
  errors_K.col(0).tail(100).setOnes();
  errors_K.col(1).setLinSpaced(-0.5, 2.0);
  const Panel answers_um = answer_to_errors(data, run, 0, 0, errors_K);
  for (Eigen::Index i = 0; i < errors_K.cols(); ++i) {
    MeasuredRun wrong = run;
    wrong.temps_K[0] += errors_K.col(i);
    const Column expected = model_over(model, wrong, data)[0] - model_over(model, run, data)[0];
    CHECK((answers_um.col(i) - expected).cwiseAbs().maxCoeff() < 1e-9);
  }
  CHECK(answers_um(201, 0) < 3.5);
  CHECK(answers_um(299, 0) > 4.9);
}

TEST_CASE("columns of reading faults equal the change of the prediction", "[diagnosis]") {
  const ThermalModel model = model_with_bank();
  const MeasuredData data = data_of(model, 300);
  const MeasuredRun& run = data.runs.front();
  const Column right_um = model_over(model, run, data)[0];
  std::size_t faults = 0;
  for (const Hypothesis& fault : hypotheses(data)) {
    if (!fault.sensor || *fault.sensor != 0) continue;
    const Shape shape = {fault.shape[0].grid[fault.shape[0].grid.size() / 3]};
    MeasuredRun wrong = run;
    wrong.temps_K[0] += fault.errors_K(run, {shape}).col(0);
    const Column missing_um = right_um - model_over(model, wrong, data)[0];
    INFO(fault.cause);
    CHECK((fault.columns({shape}, 0).col(0) - missing_um).cwiseAbs().maxCoeff() < 1e-9);
    CHECK(missing_um.cwiseAbs().maxCoeff() > 0.1);
    ++faults;
  }
  CHECK(faults == 3);  // step, drift, loose
}

TEST_CASE("exchanged readings and play of a reading act through a bank of lags", "[diagnosis]") {
  const ThermalModel model = model_with_bank();
  const MeasuredData data = data_of(model, 300);
  MeasuredRun denoised = data.runs.front();
  denoised.temps_K = denoised.denoised_K;
  const Column before_um = model_over(model, denoised, data)[0];
  for (const Hypothesis& of : hypotheses(data)) {
    const bool play = of.cause == "hysteresis" && of.subject == "t1_degC";
    if (of.cause != "sensor_swap" && !play) continue;
    const Shape shape = play ? Shape{of.shape[0].grid[5]} : Shape{};
    ThermalModel extended = model;
    extended.terms.push_back({of.cause, of.subject, {}, {}});
    if (play) extended.terms.back().shared["width_K"] = shape[0];
    const Column more_um = model_over(extended, denoised, data)[0] - before_um;
    INFO(of.cause);
    CHECK((of.columns({shape}, 0).col(0) - more_um).cwiseAbs().maxCoeff() < 1e-9);
    CHECK(more_um.cwiseAbs().maxCoeff() > 0.1);
  }
}

TEST_CASE("the gain of a lag is bounded by the steady-state effect of coefficient and bank",
          "[diagnosis]") {
  const MeasuredData data = data_of(model_with_bank(), 300);
  CHECK(settled_um_per_K(data, 0, 0) == Approx(5.0));
  CHECK(settled_um_per_K(data, 0, 1) == Approx(0.9));
  for (const Hypothesis& lag : hypotheses(data)) {
    if (lag.cause != "thermal_lag" || lag.subject != "t1_degC") continue;
    CHECK(lag.bounds(0).low == 0.0);
    CHECK(lag.bounds(0).high > 4.5);
    CHECK(lag.bounds(0).high < 7.0);
  }
}
