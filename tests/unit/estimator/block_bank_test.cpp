#include <cmath>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "estimator/sensing/sensing.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

SensorConfig sensor_of(const std::string& name) {
  SensorConfig sensor;
  sensor.name = name;
  sensor.smoothing.form = SmoothingForm::off;
  sensor.screening.settle_s = 0.0;
  return sensor;
}

EstimatorConfig config_of(const std::vector<std::string>& sensors,
                          const std::vector<BlockConfig>& blocks) {
  EstimatorConfig config;
  for (const std::string& name : sensors) config.sensors.push_back(sensor_of(name));
  config.blocks = blocks;
  return config;
}

/// Readings at `now`; NaN: the sensor does not answer.
bool step(BlockBank& bank, nanoseconds now, const std::vector<double>& temps_degC) {
  std::vector<Reading> readings;
  for (const double value : temps_degC)
    readings.push_back({value, now, std::isnan(value) ? Fault::no_answer : Fault::none});
  bank.read(now, readings);
  return bank.join({});
}

}  // namespace

TEST_CASE("a block's temperature is the mean of its sensors", "[blocks]") {
  const auto config =
      config_of({"a", "b", "c"}, {{"one", "t1_degC", {0, 2}}, {"two", "t2_degC", {1}}});
  BlockBank bank(config, {"t2_degC", "t1_degC"});  // order of the model's columns
  CHECK(step(bank, 1s, {20.0, 30.0, 21.0}));
  CHECK(bank.temps_degC()[0] == 30.0);
  CHECK(bank.temps_degC()[1] == 20.5);
}

TEST_CASE("the loss of a sensor does not shift the mean", "[blocks]") {
  BlockBank bank(config_of({"a", "b", "c"}, {{"one", "t1_degC", {0, 1, 2}}}), {"t1_degC"});
  step(bank, 1s, {20.0, 23.0, 26.0});
  CHECK(bank.temps_degC()[0] == 23.0);
  CHECK(step(bank, 10s, {20.0, 23.0, not_a_number}));
  CHECK(bank.temps_degC()[0] == 23.0);
  // The others rise by 1 K, and so does the block.
  CHECK(step(bank, 12s, {21.0, 24.0, not_a_number}));
  CHECK(bank.temps_degC()[0] == 24.0);
  CHECK(step(bank, 20s, {not_a_number, 24.5, not_a_number}));
  CHECK(bank.temps_degC()[0] == 24.5);
  CHECK(step(bank, 22s, {21.5, 24.5, 27.5}));
  CHECK(bank.temps_degC()[0] == 24.5);
}

TEST_CASE("a block without a good sensor is lost and keeps its last temperature", "[blocks]") {
  BlockBank bank(config_of({"a", "b"}, {{"one", "t1_degC", {0}}, {"two", "t2_degC", {1}}}),
                 {"t1_degC", "t2_degC"});
  CHECK_FALSE(step(bank, 1s, {20.0, not_a_number}));
  CHECK(bank.good(0));
  CHECK_FALSE(bank.good(1));
  CHECK(std::isnan(bank.temps_degC()[1]));
  CHECK(step(bank, 2s, {20.0, 25.0}));
  CHECK(step(bank, 5s, {20.0, not_a_number}));              // the last reading is still used
  CHECK_FALSE(step(bank, 7s + 1ns, {20.0, not_a_number}));  // stale
  CHECK(bank.temps_degC()[1] == 25.0);
  CHECK(step(bank, 9s, {20.0, 25.5}));
  CHECK(bank.temps_degC()[1] == 25.5);
}

TEST_CASE("a difference sensor gives the difference to its reference of the same cycle",
          "[blocks]") {
  auto config = config_of({"a", "bed"}, {{"one", "t1_degC", {0}}});
  config.sensors[0].reference_sensor = 1;
  BlockBank bank(config, {"t1_degC"});
  CHECK(step(bank, 1s, {25.0, 20.0}));
  CHECK(bank.temps_degC()[0] == 5.0);
  CHECK(step(bank, 2s, {25.5, 20.5}));
  CHECK(bank.temps_degC()[0] == 5.0);
  SECTION("which is lost with the reference") {
    CHECK_FALSE(step(bank, 8s, {25.5, not_a_number}));
    CHECK(bank.temps_degC()[0] == 5.0);
    CHECK(step(bank, 9s, {25.5, 21.0}));
    CHECK(bank.temps_degC()[0] == 4.5);
  }
}

TEST_CASE("sensors, columns or references that do not exist are refused", "[blocks]") {
  auto config = config_of({"a"}, {{"one", "t1_degC", {0}}});
  const auto refuses = [&config](const char* column, const char* message) {
    CHECK_THROWS_WITH(BlockBank(config, {column}), message);
  };
  refuses("t2_degC", "model.inputs = t2_degC: no [[block]] has this input");
  config.blocks[0].sensors = {1};
  refuses("t1_degC", "block[one].sensors = 1: must be the index of a sensor");
  config.blocks[0].sensors = {};
  refuses("t1_degC", "block[one].sensors = []: must name a sensor");
  config.blocks[0].sensors = {0};
  config.sensors[0].reference_sensor = 1;
  refuses("t1_degC", "sensor[a].reference_sensor = 1: must be the index of a sensor");
}

TEST_CASE("a reload keeps the smoothing of unchanged sensors and restarts the others", "[blocks]") {
  auto config = config_of({"a", "b", "bed"}, {{"one", "t1_degC", {0}}, {"two", "t2_degC", {1}}});
  for (SensorConfig& sensor : config.sensors) {
    sensor.smoothing.form = SmoothingForm::sliding_line;
    sensor.smoothing.period_s = 0;
  }
  config.sensors[0].reference_sensor = 2;
  BlockBank before(config, {"t1_degC", "t2_degC"});
  for (int i = 0; i < 6; ++i) step(before, i * 1s, {25.0, 30.0, 20.0});
  auto changed = config;
  changed.sensors[1].smoothing.half_width_K = 0.5;
  BlockBank after(changed, {"t1_degC", "t2_degC"});
  after.plan_adoption(before);
  after.adopt(before);
  step(after, 6s, {26.0, 31.0, 20.0});
  CHECK(after.temps_degC()[0] == Approx(5.3));   // clipped: the history continued
  CHECK(after.temps_degC()[1] == Approx(31.0));  // restarted: passes through
}
