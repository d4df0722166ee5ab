/// Targets of the axes, and the controller's signals in a step.
#include <cmath>
#include <memory>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/pipeline/prediction.hpp"
#include "estimator/pipeline/targets.hpp"
#include "small_machine.hpp"

using namespace thermocomp;

namespace {

const std::vector<double> axis_um{4.0};

Signals cutting(double value, bool online = true) {
  Signals signals;
  signals.online = online;
  signals.watches_cutting = true;
  signals.cutting = value;
  return signals;
}

Targets targets(Mode mode, const Signals& signals, const EstimatorConfig& config = small_config(),
                bool held = false) {
  // The spans in Targets need a rule that outlives the call.
  static std::unique_ptr<TargetRule> rule;
  rule = std::make_unique<TargetRule>(config);
  Displacement displacement;
  displacement.held = held;
  return rule->step(mode, axis_um, displacement, signals);
}

EstimatorConfig with_cutting_signal() {
  EstimatorConfig config = small_config();
  config.compensation.cutting_signal = "cutting_on";
  return config;
}

}  // namespace

TEST_CASE("the target is the negative of the displacement, zero, or NaN (stay)", "[targets]") {
  CHECK(targets(Mode::compensating, {}).axis_um[0] == -4.0);
  CHECK(targets(Mode::disabled, {}).axis_um[0] == 0.0);
  CHECK(targets(Mode::ramping_to_zero, {}).axis_um[0] == 0.0);
  CHECK(std::isnan(targets(Mode::holding, {}).axis_um[0]));
  CHECK(std::isnan(targets(Mode::starting, {}).axis_um[0]));
  CHECK(targets(Mode::compensating, {}).hold_where_unknown);
  CHECK_FALSE(targets(Mode::holding, {}).hold_where_unknown);
  EstimatorConfig reversed = small_config();
  reversed.axes[0].sign = -1.0;
  CHECK(targets(Mode::compensating, {}, reversed).axis_um[0] == 4.0);
}

TEST_CASE("held outside the model's domain, a compensating axis stays", "[targets]") {
  CHECK(std::isnan(targets(Mode::compensating, {}, small_config(), true).axis_um[0]));
  CHECK(targets(Mode::disabled, {}, small_config(), true).axis_um[0] == 0.0);
}

TEST_CASE("the ramp to zero waits while cutting is not excluded", "[targets]") {
  for (const Signals& unclear : {cutting(1.0), cutting(not_a_number), cutting(0.0, false)}) {
    const Targets waiting = targets(Mode::ramping_to_zero, unclear);
    CHECK(waiting.waits_for_cut);
    CHECK(std::isnan(waiting.axis_um[0]));
    CHECK(targets(Mode::disabled, unclear).axis_um[0] == 0.0);
  }
  const Targets clear = targets(Mode::ramping_to_zero, cutting(0.0));
  CHECK_FALSE(clear.waits_for_cut);
  CHECK(clear.axis_um[0] == 0.0);
}

TEST_CASE("hold_while_cutting lets the offset change only on a definite signal", "[targets]") {
  EstimatorConfig config = small_config();
  config.compensation.hold_while_cutting = true;
  CHECK(targets(Mode::compensating, cutting(0.0), config).may_change);
  CHECK_FALSE(targets(Mode::compensating, cutting(1.0), config).may_change);
  CHECK_FALSE(targets(Mode::compensating, cutting(not_a_number), config).may_change);
  CHECK_FALSE(targets(Mode::compensating, cutting(0.0, false), config).may_change);
  CHECK(targets(Mode::compensating, cutting(1.0)).may_change);
}

TEST_CASE("a controller that is offline or stale gives no signals; the last ones stay known",
          "[signals]") {
  SignalIntake intake(with_cutting_signal(), model_with_growth());
  ControllerState controller;
  controller.online = true;
  controller.written = controller.online;
  controller.taken_at = 10s;
  controller.signals[0] = 3000.0;
  controller.signals[1] = 1.0;
  controller.signals[2] = 0.0;
  Signals signals = intake.step(10s, controller);
  CHECK((signals.online && signals.complete && signals.watches_cutting));
  CHECK(signals.of_model[0] == 3000.0);
  CHECK(signals.cutting == 1.0);
  CHECK(std::isnan(signals.cycle_end));

  controller.signals[0] = 1.0;  // just not stale, then stale
  CHECK(intake.step(12s, controller).online);
  controller.signals[0] = 2.0;
  signals = intake.step(12s + 1ns, controller);
  CHECK_FALSE(signals.online);
  CHECK_FALSE(signals.complete);
  CHECK(signals.of_model[0] == 1.0);
  CHECK(signals.cutting == 1.0);
}

TEST_CASE("signals are complete with all that the model and the disable switch need", "[signals]") {
  SignalIntake intake(with_cutting_signal(), model_with_growth());
  ControllerState controller;
  controller.online = true;
  controller.written = controller.online;
  controller.signals[0] = 3000.0;
  controller.signals[1] = not_a_number;  // the cutting signal is not needed
  controller.signals[2] = 0.0;
  CHECK(intake.step({}, controller).complete);
  for (const double value : {not_a_number, 1.1e9, -HUGE_VAL}) {
    controller.signals[0] = value;
    const Signals garbled = intake.step({}, controller);
    CHECK_FALSE(garbled.complete);
    CHECK(std::isnan(garbled.of_model[0]));
  }
  controller.signals[0] = 3000.0;
  controller.signals[2] = not_a_number;
  CHECK_FALSE(intake.step({}, controller).complete);
}
