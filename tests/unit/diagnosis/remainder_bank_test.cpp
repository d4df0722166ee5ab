#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/model/model_file.hpp"
#include "modelling/diagnosis/answer/findings.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

constexpr int rows_of_a_run = 900;

ThermalModel one_sensor() {
  ThermalModel model;
  model.inputs = {"t1_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{5.0}};
  return model;
}

/// A speed that changes every 45 min, a reading that follows it, and a displacement that the model
/// has but for `lags_um` of two low passes of each, and `noise_um`.
RunFile machine(unsigned seed, double lags_um, double noise_um) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, noise_um);
  std::uniform_int_distribution<int> speed(0, 3);
  RunFile run;
  run.name = "run.csv";
  run.columns = {"time_s", "t1_degC", "spindle_rpm", "z_um"};
  run.values.resize(run.columns.size());
  double rise_K = 0.0;
  double quick_K = 0.0;
  double slow_K = 0.0;
  double warm = 0.0;
  double rpm = 0.0;
  for (int row = 0; row < rows_of_a_run; ++row) {
    if (row % 45 == 20) rpm = 1500.0 * speed(random);
    rise_K += (rpm / 500.0 - rise_K) / 40.0;
    quick_K += (rise_K - quick_K) / 8.0;
    slow_K += (rise_K - slow_K) / 70.0;
    warm += (rpm / 4500.0 - warm) / 25.0;
    run.values[0].push_back(60.0 * row);
    run.values[1].push_back(20.0 + rise_K);
    run.values[2].push_back(rpm);
    run.values[3].push_back(5.0 * rise_K +
                            lags_um * (quick_K - 0.7 * slow_K - 1.5 * warm - 0.3 * rise_K) +
                            noise(random));
  }
  run.selected_end = run.rows();
  return run;
}

MeasuredData data_of(const ThermalModel& model, const RunFile& run) {
  return measured_data(model, {run}, shared_columns(model, {run}));
}

std::optional<RemainderBank> bank_of(const RunFile& run) {
  const MeasuredData data = data_of(one_sensor(), run);
  std::vector<double> predictable;
  return remainder_bank(data, residuals(data), {false}, predictable);
}

double left_um(const ThermalModel& model, const RunFile& run) {
  return root_mean_square(residuals(data_of(model, run))[0]);
}

}  // namespace

TEST_CASE("a bank of several lags predicts another run", "[diagnosis]") {
  const auto bank = bank_of(machine(1, 3.0, 0.1));
  REQUIRE(bank);
  const LeftOutRms gain = bank->left_out.at("z_um");
  CHECK(gain.after_um < 0.3 * gain.before_um);
  ThermalModel longer = one_sensor();
  longer.terms.push_back(bank->term);
  const RunFile other = machine(2, 3.0, 0.1);
  CHECK(left_um(longer, other) < 0.3 * left_um(one_sensor(), other));
}

TEST_CASE("a bank survives writing and reading of the model file", "[diagnosis]") {
  const auto bank = bank_of(machine(1, 3.0, 0.1));
  REQUIRE(bank);
  ThermalModel longer = one_sensor();
  longer.terms.push_back(bank->term);
  const ThermalModel read = parse_model(write_model(longer), "model.toml");
  const RunFile other = machine(2, 3.0, 0.1);
  CHECK(left_um(read, other) == Approx(left_um(longer, other)).epsilon(1e-9));
}

TEST_CASE("noise gets no bank", "[diagnosis]") {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    CAPTURE(seed);
    CHECK_FALSE(bank_of(machine(seed, 0.0, 1.0)));
  }
}

TEST_CASE("a displacement probed every half hour is enough for a bank", "[diagnosis]") {
  RunFile run = machine(1, 3.0, 0.1);
  for (std::size_t row = 0; row < run.rows(); ++row)
    if (row % 30 != 0) run.values[3][row] = std::nan("");
  const auto bank = bank_of(run);
  REQUIRE(bank);
  ThermalModel longer = one_sensor();
  longer.terms.push_back(bank->term);
  const RunFile other = machine(2, 3.0, 0.1);
  CHECK(left_um(longer, other) < 0.7 * left_um(one_sensor(), other));
}

TEST_CASE("a matrix fitted to the rows is fitted again in cross-validation", "[diagnosis]") {
  // Two speeds of one reading: what a static fit leaves of its own rows is little, and less of it
  // can be predicted than of what it leaves of others.
  const RunFile run = machine(1, 3.0, 0.1);
  const MeasuredData probe = data_of(one_sensor(), run);
  double square = 0.0;
  double product = 0.0;
  for (std::size_t row = 0; row < run.rows(); ++row) {
    const double rise_K = run.values[1][row] - run.values[1][0];
    square += rise_K * rise_K;
    product += rise_K * (run.values[3][row] - run.values[3][0]);
  }
  ThermalModel fitted = one_sensor();
  fitted.matrix_um_per_K = {{product / square}};
  const MeasuredData data = data_of(fitted, run);
  std::vector<double> predictable;
  const auto bank = remainder_bank(data, residuals(data), {true}, predictable);
  REQUIRE(bank);
  CHECK(bank->changes_coefficients);
  ThermalModel longer = fitted;
  longer.terms.push_back(bank->term);
  const RunFile other = machine(2, 3.0, 0.1);
  CHECK(left_um(longer, other) < 0.3 * left_um(fitted, other));
}
