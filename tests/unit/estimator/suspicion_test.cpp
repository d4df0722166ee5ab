#include "estimator/sensing/suspicion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/pipeline/estimator.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

constexpr std::size_t places = 6;
constexpr double hour_s = 3600.0;

/// A machine with day and night and a spindle that is on for 4 h in every 8 h; each place follows
/// both with its own share and lag.
double true_degC(std::size_t place, double time_s) {
  const double day = std::sin(2.0 * std::numbers::pi *
                              (time_s - 900.0 * static_cast<double>(place)) / (24.0 * hour_s));
  const double tau_s = 1200.0 + 300.0 * static_cast<double>(place);
  const double in_period_s = std::fmod(time_s, 8.0 * hour_s);
  const double on_s = 4.0 * hour_s;
  const double end = 1.0 - std::exp(-on_s / tau_s);
  const double heat = in_period_s < on_s ? 1.0 - std::exp(-in_period_s / tau_s)
                                         : end * std::exp(-(in_period_s - on_s) / tau_s);
  // Noise of a converter, the same in every run.
  const double phase = 12.9898 * time_s + 78.233 * static_cast<double>(place);
  const double noise = 0.02 * std::sin(1000.0 * std::sin(phase));
  return 22.0 + 2.0 * day + (2.0 + static_cast<double>(place)) * heat + noise;
}

/// Appended, since GCC 12 reports a false overflow in sums of strings.
std::string named(const char* head, std::size_t place, const char* tail = "") {
  std::string name(head);
  return name.append(std::to_string(place + 1)).append(tail);
}

/// Result of `thermocomp covariance` for two days of it.
ThermalModel model_of_machine() {
  ThermalModel model;
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{4.0, 1.0, 1.0, 1.0, 1.0, 1.0}};
  std::vector<double> mean(places, 0.0);
  const int rows = 2880;
  for (std::size_t i = 0; i < places; ++i) {
    model.inputs.push_back(named("t", i, "_degC"));
    for (int row = 0; row < rows; ++row) mean[i] += true_degC(i, 60.0 * row) / rows;
  }
  model.covariance_K2.assign(places, std::vector<double>(places, 0.0));
  for (int row = 0; row < rows; ++row)
    for (std::size_t i = 0; i < places; ++i)
      for (std::size_t k = 0; k < places; ++k)
        model.covariance_K2[i][k] += (true_degC(i, 60.0 * row) - mean[i]) *
                                     (true_degC(k, 60.0 * row) - mean[k]) / (rows - 1);
  model.covariance_growth.drift_time_s = 24.0 * hour_s;
  model.covariance_growth.scatter_time_s = 60.0;
  model.covariance_growth.drift_factor.assign(places, 4.0);
  model.covariance_growth.scatter_factor.assign(places, 1.0);
  return model;
}

EstimatorConfig config_of(SuspectedPolicy policy, std::size_t sensors_a_block = 1) {
  EstimatorConfig config;
  for (std::size_t i = 0; i < places; ++i) {
    BlockConfig block{named("b", i), named("t", i, "_degC"), {}};
    for (std::size_t k = 0; k < sensors_a_block; ++k) {
      SensorConfig sensor;
      sensor.name = named("s", i).append(k, 'x');
      sensor.smoothing.form = SmoothingForm::off;
      sensor.screening.stale_after_s = 60.0;
      sensor.screening.settle_s = 0.0;
      sensor.screening.rate_allowance_K = 50.0;  // screening must not refuse before suspicion acts
      block.sensors.push_back(config.sensors.size());
      config.sensors.push_back(sensor);
    }
    config.blocks.push_back(block);
  }
  config.axes = {{"z", "z_um", 1.0, {200.0, 0.05}}};
  config.controller_reads_back = false;
  config.compensation.enabled_at_first_start = true;
  config.compensation.offset_sd_um_max = 100.0;
  config.compensation.controller_stale_after_s = 60.0;
  config.compensation.suspected_sensors = policy;
  return config;
}

using ReadingError = std::function<double(std::size_t sensor, double true_degC, double time_s)>;
double no_error(std::size_t, double temp_degC, double) {
  return temp_degC;
}
/// The sensor reads 2 K more from 20 h on.
double jumped(std::size_t sensor, double temp_degC, double time_s) {
  return sensor == 2 && time_s >= 20.0 * hour_s ? temp_degC + 2.0 : temp_degC;
}

/// Steps of 12 s, beginning at 16 h.
struct Shop {
  explicit Shop(const EstimatorConfig& config, const ThermalModel& model = model_of_machine())
      : estimator(config, model),
        per_block(config.sensors.size() / places),
        readings(config.sensors.size()) {
    controller.online = true;
    controller.written = controller.online;
    controller.link_epoch = 1;
    controller.applied_um.fill(0.0);
  }
  void step(const ReadingError& error_of) {
    time_s += 12.0;
    const nanoseconds now{static_cast<std::int64_t>(1e9 * time_s)};
    for (std::size_t i = 0; i < readings.size(); ++i) {
      const double temp_degC = error_of(i, true_degC(i / per_block, time_s), time_s);
      readings[i] = {temp_degC, now, std::isnan(temp_degC) ? Fault::open_circuit : Fault::none};
    }
    controller.taken_at = now;
    const double before_um = command.offset_um[0];
    estimator.step(now, readings, controller, command);
    largest_step_um = std::max(largest_step_um, std::abs(command.offset_um[0] - before_um));
    report = estimator.make_report();
    if (time_s > 16.1 * hour_s && report.mode != Mode::compensating) ++idle_steps;
    for (std::size_t i = 0; i < readings.size(); ++i)
      if (report.sensors[i].suspected && first_s.at(i) == 0.0) first_s.at(i) = time_s;
  }
  void run_until(double hours, const ReadingError& error_of) {
    while (time_s < hours * hour_s) step(error_of);
  }
  [[nodiscard]] std::vector<std::string> suspected() const {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < readings.size(); ++i)
      if (report.sensors[i].suspected) names.push_back(estimator.config().sensors[i].name);
    return names;
  }
  [[nodiscard]] bool ever(std::size_t sensor) const { return first_s[sensor] > 0.0; }
  [[nodiscard]] bool ever_any() const {
    return std::any_of(first_s.begin(), first_s.end(), [](double each) { return each > 0.0; });
  }

  Estimator estimator;
  std::size_t per_block;
  std::vector<Reading> readings;
  ControllerState controller;
  OffsetCommand command;
  Report report;
  double time_s{16.0 * hour_s};
  double largest_step_um{0.0};
  int idle_steps{0};
  std::vector<double> first_s = std::vector<double>(3 * places, 0.0);
};

using Names = std::vector<std::string>;

}  // namespace

TEST_CASE("a sensor that jumps is suspected within ten minutes, with size and time",
          "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::warn));
  shop.run_until(20.0, no_error);
  CHECK_FALSE(shop.ever_any());
  shop.run_until(20.0 + 1.0 / 6.0, jumped);
  REQUIRE(shop.suspected() == Names{"s3"});
  CHECK(shop.report.sensors[2].suspected_size_K == Approx(2.0).margin(0.2));
  CHECK(seconds_d(shop.report.sensors[2].suspected_since).count() ==
        Approx(20.0 * hour_s).margin(90.0));
  CHECK(has_reason(shop.report.reasons, Reason::sensor_suspected));
  shop.run_until(30.0, jumped);
  CHECK(shop.suspected() == Names{"s3"});
  CHECK(shop.report.sensors[2].suspected_size_K == Approx(2.0).margin(0.4));
}

TEST_CASE("a warning changes no offset by one bit", "[estimator][suspicion]") {
  Shop warns(config_of(SuspectedPolicy::warn));
  Shop looks_away(config_of(SuspectedPolicy::off));
  while (warns.time_s < 22.0 * hour_s) {
    warns.step(jumped);
    looks_away.step(jumped);
    REQUIRE(warns.command.offset_um[0] == looks_away.command.offset_um[0]);
  }
  CHECK(warns.ever(2));
  CHECK_FALSE(looks_away.ever_any());
}

TEST_CASE("day, night and a common warm-up raise no suspicion", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::weigh_down));
  shop.run_until(16.0 + 72.0, no_error);
  CHECK_FALSE(shop.ever_any());
}

TEST_CASE("a change of all sensors at once is no error", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::warn));
  shop.run_until(24.0, [](std::size_t, double temp_degC, double time_s) {
    return time_s > 20.0 * hour_s ? temp_degC + 2.0 : temp_degC;
  });
  CHECK_FALSE(shop.ever_any());
}

TEST_CASE("a spike of two minutes raises no suspicion", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::warn));
  shop.run_until(24.0, [](std::size_t sensor, double temp_degC, double time_s) {
    const bool spike = sensor == 4 && std::fmod(time_s, 1800.0) < 24.0;
    return spike ? temp_degC + 3.0 : temp_degC;
  });
  CHECK_FALSE(shop.ever_any());
}

TEST_CASE("a sensor that creeps is suspected", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::warn));
  shop.run_until(30.0, [](std::size_t sensor, double temp_degC, double time_s) {
    const double hours = time_s / hour_s - 18.0;
    return sensor == 5 && hours > 0 ? temp_degC + 0.4 * hours : temp_degC;
  });
  CHECK(shop.ever(5));
  CHECK(shop.suspected() == Names{"s6"});
}

TEST_CASE("a sensor that works loose is suspected at a warm-up", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::warn));
  const double then_degC = true_degC(4, 20.0 * hour_s);
  shop.run_until(30.0, [&](std::size_t sensor, double temp_degC, double time_s) {
    return sensor == 4 && time_s > 20.0 * hour_s ? then_degC + 0.4 * (temp_degC - then_degC)
                                                 : temp_degC;
  });
  CHECK(shop.ever(4));
  for (const std::size_t other : {0u, 1u, 2u, 3u, 5u}) CHECK_FALSE(shop.ever(other));
}

TEST_CASE("two sensors wrong at once are both named, or none is", "[estimator][suspicion]") {
  // With opposite signs they shift the expectation of each neighbour by more than their own errors.
  const double second_K = GENERATE(1.5, -3.0);
  Shop shop(config_of(SuspectedPolicy::warn));
  shop.run_until(20.5, [&](std::size_t sensor, double temp_degC, double time_s) {
    if (time_s < 20.0 * hour_s) return temp_degC;
    return sensor == 1 ? temp_degC + 2.0 : sensor == 4 ? temp_degC + second_K : temp_degC;
  });
  for (const std::size_t other : {0u, 2u, 3u, 5u}) CHECK_FALSE(shop.ever(other));
  if (second_K < 0) return;
  CHECK(shop.suspected() == Names{"s2", "s5"});
  CHECK(shop.report.sensors[1].suspected_size_K == Approx(2.0).margin(0.3));
  CHECK(shop.report.sensors[4].suspected_size_K == Approx(second_K).margin(0.3));
}

TEST_CASE("a second error does not change the size of the first", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::warn));
  shop.run_until(22.5, [](std::size_t sensor, double temp_degC, double time_s) {
    if (sensor == 1 && time_s > 20.0 * hour_s) return temp_degC + 2.0;
    return sensor == 0 && time_s > 21.5 * hour_s ? temp_degC - 3.0 : temp_degC;
  });
  REQUIRE(shop.suspected() == Names{"s1", "s2"});
  CHECK(shop.report.sensors[1].suspected_size_K == Approx(2.0).margin(0.4));
}

TEST_CASE("a faulted neighbour is ignored, the others still count", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::warn));
  shop.run_until(20.5, [](std::size_t sensor, double temp_degC, double time_s) {
    return sensor == 3 && time_s > 19.95 * hour_s ? not_a_number
                                                  : jumped(sensor, temp_degC, time_s);
  });
  CHECK(shop.suspected() == Names{"s3"});
}

TEST_CASE("a suspicion ends when the sensor agrees again", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::weigh_down));
  const auto back = [](std::size_t sensor, double temp_degC, double time_s) {
    return time_s < 21.0 * hour_s ? jumped(sensor, temp_degC, time_s) : temp_degC;
  };
  shop.run_until(21.0, back);
  REQUIRE(shop.suspected() == Names{"s3"});
  shop.run_until(21.0 + 0.25, back);
  CHECK(shop.suspected().empty());
  shop.run_until(26.0, back);
  CHECK(shop.suspected().empty());
  CHECK(shop.report.inputs[2].good);
}

TEST_CASE("a suspected sensor that is faulted for ten minutes starts anew on its return",
          "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::weigh_down));
  shop.run_until(24.0, [](std::size_t sensor, double temp_degC, double time_s) {
    const bool unplugged = time_s > 21.0 * hour_s && time_s < 21.5 * hour_s;
    return sensor == 2 && unplugged ? not_a_number : jumped(sensor, temp_degC, time_s);
  });
  CHECK(shop.ever(2));
  CHECK(shop.suspected().empty());
  CHECK(shop.report.inputs[2].good);
}

TEST_CASE("a new reference ends suspicions", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::warn));
  shop.run_until(21.0, jumped);
  REQUIRE(shop.suspected() == Names{"s3"});
  shop.estimator.apply({CommandKind::reference, 0, 0.0});
  shop.step(jumped);
  CHECK(shop.suspected().empty());
  shop.run_until(23.0, jumped);
  CHECK(shop.suspected().empty());
}

TEST_CASE("with weigh_down the error leaves the offset at the slew rate, without a pause",
          "[estimator][suspicion]") {
  Shop with_wrong_sensor(config_of(SuspectedPolicy::weigh_down));
  Shop true_one(config_of(SuspectedPolicy::off));
  with_wrong_sensor.run_until(20.0, jumped);
  true_one.run_until(20.0, no_error);
  double worst_um = 0.0;
  while (with_wrong_sensor.time_s < 23.0 * hour_s) {
    with_wrong_sensor.step(jumped);
    true_one.step(no_error);
    const double off_um =
        std::abs(with_wrong_sensor.command.offset_um[0] - true_one.command.offset_um[0]);
    if (with_wrong_sensor.time_s > 20.0 * hour_s + 600.0) worst_um = std::max(worst_um, off_um);
  }
  CHECK(with_wrong_sensor.report.sensors[2].weighed_down);
  CHECK(with_wrong_sensor.report.inputs[2].estimated);
  CHECK(with_wrong_sensor.report.inputs[2].sd_K > 0.0);
  CHECK(worst_um < 1.0);  // of the 2 um that 2 K give
  CHECK(with_wrong_sensor.idle_steps == 0);
  CHECK(with_wrong_sensor.largest_step_um <= 0.05 * 12.0 + 1e-9);
}

TEST_CASE("where an estimate would be too uncertain the suspected sensor is still used",
          "[estimator][suspicion]") {
  EstimatorConfig config = config_of(SuspectedPolicy::weigh_down);
  config.compensation.offset_sd_um_max = GENERATE(0.001, 0.02, 0.15, 0.3);
  Shop shop(config);
  shop.run_until(32.0, jumped);
  CHECK(shop.suspected() == Names{"s3"});
  CHECK(shop.idle_steps == 0);
  if (config.compensation.offset_sd_um_max > 0.1) return;  // usable for long
  CHECK_FALSE(shop.report.sensors[2].weighed_down);
  CHECK(shop.report.inputs[2].good);
}

TEST_CASE("a block of several sensors continues without the wrong one", "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::weigh_down, 3));
  const auto error_of = [](std::size_t sensor, double temp_degC, double time_s) {
    return sensor == 7 && time_s > 20.0 * hour_s ? temp_degC + 3.0 : temp_degC;
  };
  shop.run_until(22.0, error_of);
  REQUIRE(shop.suspected() == Names{"s3x"});
  CHECK(shop.report.inputs[2].good);
  CHECK(shop.report.inputs[2].temp_degC == Approx(true_degC(2, shop.time_s)).margin(0.15));
  CHECK(shop.idle_steps == 0);
}

TEST_CASE("a state saved during a suspicion continues as if never saved",
          "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::weigh_down));
  shop.run_until(20.0 + 0.12, jumped);
  std::vector<std::byte> state(shop.estimator.state_size_bytes());
  shop.estimator.save_state(state);
  Shop loaded(config_of(SuspectedPolicy::weigh_down));
  loaded.estimator.load_state(state);
  loaded.time_s = shop.time_s;
  while (shop.time_s < 24.0 * hour_s) {
    shop.step(jumped);
    loaded.step(jumped);
    REQUIRE(loaded.command.offset_um[0] == shop.command.offset_um[0]);
  }
  CHECK(loaded.suspected() == shop.suspected());
  CHECK_FALSE(loaded.suspected().empty());
}

TEST_CASE("a reload adopts suspicions by name, and with warn the sensor is used again",
          "[estimator][suspicion]") {
  Shop shop(config_of(SuspectedPolicy::weigh_down));
  shop.run_until(21.0, jumped);
  REQUIRE(shop.report.sensors[2].weighed_down);
  const auto policy = GENERATE(SuspectedPolicy::weigh_down, SuspectedPolicy::warn);
  Estimator next(config_of(policy), model_of_machine());
  next.plan_adoption(shop.estimator);
  next.adopt(shop.estimator);
  shop.estimator = std::move(next);
  shop.run_until(22.0, jumped);
  CHECK(shop.suspected() == Names{"s3"});
  CHECK(shop.report.sensors[2].weighed_down == (policy == SuspectedPolicy::weigh_down));
  CHECK(shop.idle_steps == 0);
  CHECK(shop.largest_step_um <= 0.05 * 12.0 + 1e-9);
}

namespace {

/// Random numbers by seed.
struct Dice {
  std::uint64_t state;
  double operator()(double low, double high) {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return low + (high - low) * static_cast<double>(state >> 11) * 0x1p-53;
  }
};

/// Up to four sensors that jump, creep or work loose for a while each, and some that fail.
class WrongSensors {
 public:
  explicit WrongSensors(std::uint64_t seed) : dice_{seed} {
    for (auto& each : wrong_)
      each = {static_cast<std::size_t>(dice_(0.0, 5.999)), dice_(0.0, 4.0),
              hour_s * dice_(17.0, 27.0), hour_s * dice_(0.1, 6.0), dice_(-6.0, 6.0)};
  }
  double operator()(std::size_t sensor, double temp_degC, double time_s) const {
    for (const auto& each : wrong_) {
      const double since_s = time_s - each.begin_s;
      if (each.sensor != sensor || since_s < 0.0 || since_s > each.lasts_s) continue;
      if (each.kind < 1.0)
        temp_degC += each.size_K;
      else if (each.kind < 2.0)
        temp_degC += each.size_K * since_s / each.lasts_s;
      else if (each.kind < 3.0)
        temp_degC = 0.4 * temp_degC + 0.6 * true_degC(sensor, each.begin_s);
      else if (since_s > 600.0)
        temp_degC = not_a_number;
    }
    return temp_degC;
  }

 private:
  struct WrongSensor {
    std::size_t sensor{0};
    double kind{0.0};
    double begin_s{0.0};
    double lasts_s{0.0};
    double size_K{0.0};
  };
  Dice dice_;
  std::array<WrongSensor, 4> wrong_{};
};

}  // namespace

TEST_CASE("for any wrong and failing sensors, slew and bound hold and compensation does not end",
          "[estimator][suspicion][property]") {
  const auto seed = GENERATE(range(1u, 25u));
  Dice dice{seed};
  EstimatorConfig config = config_of(SuspectedPolicy::weigh_down);
  config.axes[0].limiter = {dice(5.0, 40.0), dice(0.005, 0.2)};
  config.compensation.offset_sd_um_max = dice(0.05, 20.0);
  const bool smooth = dice(0.0, 1.0) < 0.5;
  for (SensorConfig& sensor : config.sensors)
    if (smooth) sensor.smoothing.form = SmoothingForm::sliding_line;
  const WrongSensors wrong(seed + 1000);
  Shop weighs(config);
  config.compensation.suspected_sensors = SuspectedPolicy::off;
  Shop believes(config);
  const LimiterConfig limits = config.axes[0].limiter;
  while (weighs.time_s < 30.0 * hour_s) {
    weighs.step(wrong);
    believes.step(wrong);
    REQUIRE(std::isfinite(weighs.command.offset_um[0]));
    REQUIRE(std::abs(weighs.command.offset_um[0]) <= limits.offset_um_max + 1e-9);
    // A failed sensor may end it; a suspected one may not.
    const std::vector<InputReport>& inputs = believes.report.inputs;
    if (weighs.time_s > 16.1 * hour_s &&
        std::all_of(inputs.begin(), inputs.end(), [](const auto& each) { return each.good; }))
      REQUIRE(weighs.report.mode == Mode::compensating);
  }
  CHECK(weighs.largest_step_um <= 12.0 * limits.rate_um_per_s_max + 1e-9);
}
