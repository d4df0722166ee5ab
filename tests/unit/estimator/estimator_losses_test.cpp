#include <algorithm>
#include <cstddef>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/pipeline/estimator.hpp"
#include "small_machine.hpp"

using namespace thermocomp;

namespace {

/// Data lost at -30 um with on_loss = ramp_to_zero and hold_s = 0, during a cut.
Machine lost_mid_cut(EstimatorConfig& config) {
  config.compensation.on_loss = LossPolicy::ramp_to_zero;
  config.compensation.hold_s = 0;
  config.compensation.cutting_signal = "cutting_on";
  Machine machine(config);
  machine.step({20.0, 30.0});
  machine.steps(30, {26.0, 30.0});
  REQUIRE(machine.offset_um() == -30.0);
  machine.controller.signals[1] = 1.0;
  machine.steps(10, {lost, 30.0});
  REQUIRE(machine.report().mode == Mode::ramping_to_zero);
  return machine;
}

}  // namespace

TEST_CASE("loss of data clears no offset during a cut, or where cutting is unknown",
          "[estimator]") {
  auto config = small_config();
  Machine machine = lost_mid_cut(config);
  CHECK(machine.offset_um() == -30.0);
  CHECK(machine.reports(Reason::cutting));
  machine.controller.signals[1] = not_a_number;
  machine.steps(100, {lost, 30.0});
  CHECK(machine.offset_um() == -30.0);
  machine.controller.signals[1] = 0.0;
  machine.step({lost, 30.0});
  CHECK(machine.offset_um() == -20.0);
  CHECK_FALSE(machine.reports(Reason::cutting));
}

TEST_CASE(
    "an offset outside a new, smaller bound returns at the slew rate during a cut too and stops "
    "there",
    "[estimator]") {
  auto config = small_config();
  Machine machine = lost_mid_cut(config);
  config.axes[0].limiter = {12.0, 2.0};
  reload(machine, config, small_model());
  for (int i = 1; i <= 20; ++i) {
    machine.step({lost, 30.0});
    CHECK(machine.offset_um() == std::min(-30.0 + 2.0 * i, -12.0));
  }
  CHECK(machine.report().mode == Mode::ramping_to_zero);
  CHECK(machine.reports(Reason::cutting));
}

namespace {

/// Both blocks warm together; the effect of the column on z is 1 um/K.
ThermalModel model_with_covariance() {
  auto model = small_model();
  model.covariance_K2 = {{4.0, 3.9}, {3.9, 4.0}};
  model.covariance_growth.drift_time_s = 1e5;
  return model;
}

}  // namespace

TEST_CASE("a lost block is estimated, and compensation continues with a stated uncertainty",
          "[estimator]") {
  Machine machine(small_config(), model_with_covariance());
  machine.step({20.0, 30.0});
  machine.steps(10, {21.0, 31.0});
  CHECK(machine.report().axes[0].offset_sd_um == 0.0);
  machine.steps(10, {21.0, lost});
  CHECK(machine.report().mode == Mode::compensating);
  CHECK(machine.reports(Reason::block_estimated));
  CHECK_FALSE(machine.reports(Reason::block_lost));
  CHECK(machine.offset_um() == -6.0);  // starts at the last offset
  machine.steps(100, {23.0, lost});
  const InputReport column = machine.report().inputs[1];
  CHECK(column.estimated);
  CHECK_FALSE(column.good);
  CHECK(column.temp_degC == Approx(31.0 + 2.0 * 3.9 / 4.0).epsilon(1e-3));
  CHECK(column.sd_K > 0.0);
  CHECK(machine.report().axes[0].offset_sd_um == Approx(column.sd_K));
  CHECK(machine.offset_um() == Approx(-5.0 * 3.0 - (column.temp_degC - 30.0)));
  machine.step({23.0, 33.0});
  CHECK(machine.report().reasons == 0);
  CHECK(machine.report().axes[0].offset_sd_um == 0.0);
}

TEST_CASE("beyond offset_sd_um_max, or without estimate_lost_blocks, the offset holds",
          "[estimator]") {
  auto config = small_config();
  const bool too_uncertain = GENERATE(true, false);
  if (too_uncertain)
    config.compensation.offset_sd_um_max = 0.1;
  else
    config.compensation.estimate_lost_blocks = false;
  Machine machine(config, model_with_covariance());
  machine.step({20.0, 30.0});
  machine.steps(10, {21.0, 31.0});
  machine.steps(2000, {21.0, lost});
  CHECK(machine.report().mode == Mode::holding);
  CHECK(machine.reports(Reason::block_lost));
  CHECK_FALSE(machine.reports(Reason::block_estimated));
  CHECK(machine.report().inputs[1].estimated == too_uncertain);
  if (too_uncertain) CHECK(machine.report().axes[0].offset_sd_um > 0.1);
  const double held_um = machine.offset_um();
  machine.steps(20, {25.0, lost});
  CHECK(machine.offset_um() == held_um);
  machine.steps(20, {25.0, 31.0});
  CHECK(machine.offset_um() == -26.0);
}

TEST_CASE("no reference is taken while a block is estimated", "[estimator]") {
  Machine machine(small_config(), model_with_covariance());
  machine.step({20.0, 30.0});
  machine.steps(20, {21.0, lost});
  machine.estimator.apply({CommandKind::reference, 0, 0.0});
  machine.step({21.0, lost});
  CHECK(machine.report().inputs[0].reference_degC == 20.0);
}

TEST_CASE("a reload and a saved state continue an estimate", "[estimator]") {
  Machine machine(small_config(), model_with_covariance());
  machine.step({20.0, 30.0});
  machine.steps(20, {21.0, lost});
  const double sd_um = machine.report().axes[0].offset_sd_um;
  const double offset_um = machine.offset_um();
  std::vector<std::byte> state(machine.estimator.state_size_bytes());
  machine.estimator.save_state(state);
  Machine twin(small_config(), model_with_covariance());
  twin.estimator.load_state(state);
  twin.now = machine.now;
  twin.controller = machine.controller;
  reload(machine, small_config(), model_with_covariance());
  machine.step({21.0, lost});
  CHECK(machine.offset_um() == Approx(offset_um).margin(1e-9));
  CHECK(machine.report().mode == Mode::compensating);
  CHECK(machine.report().axes[0].offset_sd_um >= sd_um);
  twin.step({21.0, lost});
  CHECK(twin.offset_um() == Approx(offset_um).margin(1e-9));
}

TEST_CASE("a restart with a sensor still lost continues from the stored temperatures",
          "[estimator]") {
  auto config = small_config();
  Machine machine(config, model_with_covariance());
  PersistentState state;
  state.reference_degC = {{"t1_degC", 20.0}, {"t2_degC", 30.0}};
  state.temp_degC = {{"t1_degC", 22.0}, {"t2_degC", 32.0}};
  state.offset_um = {{"z", -12.0}};
  machine.estimator.restore(state);
  machine.controller.applied_um[0] = -12.0;
  machine.step({22.0, lost});
  CHECK(machine.report().mode == Mode::starting);
  machine.steps(10, {22.0, lost});
  CHECK(machine.report().mode == Mode::compensating);
  CHECK(machine.offset_um() == Approx(-12.0));
  CHECK(machine.report().inputs[1].sd_K > 0.3);
}

TEST_CASE("the standard deviation of an offset includes guideways and terms", "[estimator]") {
  auto model = model_with_covariance();
  auto config = small_config();
  config.compensation.offset_sd_um_max = 500.0;
  config.signals.emplace_back("x_mm");
  model.guideways = {{"g", "x_mm", {0.0, 100.0}, {{"z_um", {{0.0, 0.0}, {0.0, 4.0}}}}}};
  model.terms = {
      {"thermal_lag", "t2_degC", {{"tau_s", 100.0}}, {{"gain_um_per_K", {{"z_um", -2.0}}}}}};
  Machine machine(config, model);
  machine.controller.signals[3] = 50.0;
  machine.step({20.0, 30.0});
  machine.steps(20, {20.0, lost});
  const double sd_K = machine.report().inputs[1].sd_K;
  // 1 from the matrix, 2 half-way along the guideway, and 2 more until the lag has settled.
  CHECK(machine.report().axes[0].offset_sd_um == Approx(5.0 * sd_K));
}
