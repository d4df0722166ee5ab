/// True changes are accepted, false ones refused: whole estimators with the default screening.
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/pipeline/estimator.hpp"
#include "small_machine.hpp"

using namespace thermocomp;

namespace {

EstimatorConfig usual_config() {
  EstimatorConfig config = small_config();
  for (SensorConfig& sensor : config.sensors) {
    sensor.screening = ScreeningConfig{};
    sensor.smoothing = SmoothingConfig{};
  }
  return config;
}

/// Three blocks that warm together, each sensor on its own module.
EstimatorConfig three_blocks() {
  EstimatorConfig config = usual_config();
  SensorConfig third = config.sensors[1];
  third.name = "s3";
  config.sensors.push_back(third);
  config.blocks.push_back({"bed", "t3_degC", {2}});
  return config;
}

ThermalModel correlated_model(double correlation = 0.98) {
  ThermalModel model = small_model();
  model.inputs.emplace_back("t3_degC");
  model.matrix_um_per_K = {{1.0, 1.0, 1.0}};
  const double between_K2 = 4.0 * correlation;
  model.covariance_K2 = {
      {4.0, between_K2, between_K2}, {between_K2, 4.0, between_K2}, {between_K2, between_K2, 4.0}};
  return model;
}

}  // namespace

TEST_CASE("a change of unit while running holds the offset and is reported for as long as it lasts",
          "[estimator]") {
  Machine machine(usual_config());
  machine.steps(60, {20.0, 20.0});
  machine.steps(200, {22.0 - 1.0, 20.0});
  const double before_um = machine.offset_um();
  machine.steps(36000, {1.8 * 21.0 + 32.0, 20.0});
  CHECK(machine.report().mode == Mode::holding);
  CHECK(machine.reports(Reason::sensor_unconfirmed));
  CHECK(machine.report().sensors[0].fault == Fault::unconfirmed);
  CHECK(machine.report().sensors[0].jump_K == Approx(1.8 * 21.0 + 32.0 - 21.0));
  CHECK(machine.offset_um() == before_um);
  machine.steps(11, {21.5, 20.0});
  CHECK(machine.report().mode == Mode::compensating);
  CHECK_FALSE(machine.reports(Reason::sensor_unconfirmed));
}

TEST_CASE("a module whose channels all show the same after an outage is not ready", "[estimator]") {
  EstimatorConfig config = usual_config();
  for (SensorConfig& sensor : config.sensors) sensor.module = "rack";
  Machine machine(config);
  machine.steps(60, {23.0, 26.0});
  machine.steps(70, {lost, lost});
  machine.steps(300, {25.0, 25.0});
  CHECK(machine.report().mode == Mode::holding);
  machine.steps(11, {23.0, 26.1});
  CHECK(machine.report().mode == Mode::compensating);
  // Differences of a cold machine are small: that the values moved is enough.
  Machine cold(config);
  cold.steps(60, {21.5, 22.3});
  cold.steps(70, {lost, lost});
  cold.steps(300, {25.1, 25.1});
  CHECK(cold.report().mode == Mode::holding);
  cold.steps(12, {21.5, 22.4});
  CHECK(cold.report().mode == Mode::compensating);
  // In an isothermal machine equal values are correct.
  Machine even(config);
  even.steps(60, {20.0, 20.4});
  even.steps(70, {lost, lost});
  even.steps(12, {20.3, 20.3});
  CHECK(even.report().mode == Mode::compensating);
}

TEST_CASE("an accepted jump soon after the start renews the reference", "[estimator]") {
  Machine machine(usual_config());
  machine.steps(30, {12.0, 24.8});
  machine.steps(60, {23.3, 24.8});
  REQUIRE(machine.report().sensors[0].jumped);
  machine.estimator.apply({CommandKind::accept, 0, 0.0});
  machine.step({23.3, 24.8});
  CHECK(machine.report().inputs[0].reference_degC == 23.3);
  CHECK(machine.report().mode == Mode::compensating);
  machine.steps(20, {23.3, 24.8});
  CHECK(machine.offset_um() == 0.0);
}

TEST_CASE("a replaced sensor that reads 3 K more is reported, and accepted by command",
          "[estimator]") {
  const bool unplugged = GENERATE(true, false);
  Machine machine(three_blocks(), correlated_model());
  for (int i = 0; i < 3600; ++i) {
    const double temp_degC = 20.0 + 0.001 * i;
    machine.step({temp_degC, temp_degC, temp_degC});
  }
  if (unplugged) machine.steps(180, {lost, 23.6, 23.6});
  machine.steps(3600, {26.6, 23.6, 23.6});
  CHECK(machine.report().mode == Mode::compensating);
  CHECK(machine.reports(Reason::sensor_unconfirmed));
  CHECK(machine.reports(Reason::block_estimated));
  CHECK(machine.report().sensors[0].jump_K == Approx(3.0).margin(0.15));
  CHECK(machine.report().inputs[0].temp_degC == Approx(23.6).margin(0.15));
  machine.estimator.apply({CommandKind::accept, 0, 0.0});
  machine.step({26.6, 23.6, 23.6});
  CHECK(machine.report().sensors[0].smoothed_degC == Approx(26.6));
  machine.steps(1200, {26.6, 23.6, 23.6});
  CHECK(machine.report().reasons == 0);
  CHECK(machine.report().inputs[0].good);
  CHECK(machine.report().inputs[0].temp_degC == Approx(26.6));
}

TEST_CASE("an accepted jump counts at once, regardless of the smoothing before it", "[estimator]") {
  Machine machine(usual_config());
  machine.steps(600, {20.0, 20.0});
  machine.steps(15, {24.0, 20.0});
  machine.estimator.apply({CommandKind::accept, 0, 0.0});
  machine.step({24.0, 20.0});
  CHECK(machine.report().sensors[0].smoothed_degC == 24.0);
}

TEST_CASE("neighbours on other modules confirm a change missed during a fault", "[estimator]") {
  EstimatorConfig config = three_blocks();
  Machine machine(config, correlated_model());
  machine.steps(60, {20.0, 20.0, 20.0});
  machine.steps(600, {2.0, 20.0, 20.0});
  for (int i = 0; i < 3600; ++i) {
    const double temp_degC = 20.0 + 0.001 * i;
    machine.step({2.0, temp_degC, temp_degC});
  }
  // 3.6 K from its last value: beyond the limit for 70 min of a jump without confirmation.
  const double quarter_K = 18.0 / 4.0;
  REQUIRE(3.6 < quarter_K);
  machine.steps(12, {23.6, 23.6, 23.6});
  CHECK(machine.report().inputs[0].good);
  SECTION("but not another false value") {
    machine.steps(3600, {42.5, 23.6, 23.6});
    CHECK_FALSE(machine.report().inputs[0].good);
  }
}

TEST_CASE("neighbours on the same module confirm nothing", "[estimator]") {
  EstimatorConfig config = three_blocks();
  const bool all_on_one = GENERATE(true, false);
  config.sensors[0].module = config.sensors[1].module = "rack";
  config.sensors[2].module = all_on_one ? "rack" : "";
  Machine machine(config, correlated_model(0.999));
  machine.steps(60, {20.0, 20.0, 20.0});
  for (int i = 0; i < 600; ++i) {
    const double temp_degC = 20.0 + 0.012 * i;
    machine.step({2.0, temp_degC, temp_degC});
  }
  machine.steps(12, {27.2, 27.2, 27.2});
  CHECK(machine.report().inputs[0].good == !all_on_one);
}

TEST_CASE("a restart confirms no jump", "[estimator]") {
  Machine machine(usual_config());
  machine.steps(60, {20.0, 20.0});
  machine.steps(60, {68.0, 20.0});
  const PersistentState saved = machine.estimator.persistent_state(machine.report());
  CHECK(saved.jumped_from_degC == std::map<std::string, double>{{"s1", 20.0}});
  Machine restarted(usual_config());
  restarted.now = machine.now + 5s;
  REQUIRE(restarted.estimator.restore(saved).empty());
  restarted.steps(36000, {68.0, 20.0});
  CHECK(restarted.report().sensors[0].jump_K == 48.0);
  CHECK(restarted.reports(Reason::sensor_unconfirmed));
  restarted.steps(11, {20.8, 20.0});
  CHECK(restarted.report().mode == Mode::compensating);
  CHECK(restarted.estimator.persistent_state(restarted.report()).jumped_from_degC.empty());
}
