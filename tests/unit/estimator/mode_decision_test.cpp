/// Rule of the mode, case by case.
#include <catch2/catch.hpp>

#include "estimator/pipeline/targets.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

constexpr double hold_s = 10.0;

CompensationConfig config(LossPolicy on_loss = LossPolicy::hold) {
  CompensationConfig config;
  config.enabled_at_first_start = true;
  config.on_loss = on_loss;
  config.hold_s = hold_s;
  return config;
}

/// Input that lets a step compensate, `second` seconds after the first one.
ModeInput working(int second) {
  ModeInput input;
  input.time = {std::chrono::seconds(second), 1.0, second == 0};
  input.displacement_known = input.controller_online = input.axes_synced = true;
  input.controller_written = true;
  return input;
}

ModeInput lost_for(int second) {
  ModeInput input = working(second);
  input.displacement_known = false;
  return input;
}

}  // namespace

TEST_CASE("it compensates once displacement and controller are known and the offsets are written",
          "[mode]") {
  ModeDecision decision(config());
  ModeInput input = working(0);
  bool ModeInput::*const missing =
      GENERATE(&ModeInput::displacement_known, &ModeInput::controller_online,
               &ModeInput::axes_synced, &ModeInput::controller_written);
  input.*missing = false;
  CHECK(decision.step(input) == Mode::starting);
  CHECK(decision.step(working(1)) == Mode::compensating);
  input.time = working(2).time;
  CHECK(decision.step(input) == Mode::holding);
  CHECK(decision.step(working(3)) == Mode::compensating);
}

TEST_CASE("before the first data the mode is starting, for any time, and never holding", "[mode]") {
  ModeDecision decision(config());
  for (int second = 0; second < 100; ++second)
    CHECK(decision.step(lost_for(second)) == Mode::starting);
}

TEST_CASE("after hold_s without data it ramps to zero if so configured, and returns", "[mode]") {
  ModeDecision holds(config(LossPolicy::hold));
  ModeDecision ramps(config(LossPolicy::ramp_to_zero));
  for (ModeDecision* decision : {&holds, &ramps}) {
    CHECK(decision->step(working(0)) == Mode::compensating);
    CHECK(decision->step(lost_for(1)) == Mode::holding);
    CHECK(decision->step(lost_for(10)) == Mode::holding);  // exactly hold_s
  }
  CHECK(holds.step(lost_for(11)) == Mode::holding);
  CHECK(ramps.step(lost_for(11)) == Mode::ramping_to_zero);
  CHECK(ramps.step(working(12)) == Mode::compensating);
  CHECK(ramps.step(lost_for(22)) == Mode::holding);  // counted anew
}

TEST_CASE("without any data so far, the loss counts from the first step", "[mode]") {
  ModeDecision decision(config(LossPolicy::ramp_to_zero));
  ModeInput late = lost_for(1000);
  late.time.first = true;
  CHECK(decision.step(late) == Mode::starting);
  CHECK(decision.step(lost_for(1010)) == Mode::starting);
  CHECK(decision.step(lost_for(1011)) == Mode::ramping_to_zero);
}

TEST_CASE("either switch disables, in any state", "[mode]") {
  ModeDecision decision(config(LossPolicy::ramp_to_zero));
  CHECK(decision.step(working(0)) == Mode::compensating);
  decision.enable(false);
  CHECK(decision.step(working(1)) == Mode::disabled);
  CHECK(decision.step(lost_for(100)) == Mode::disabled);
  decision.stop();
  CHECK(decision.step(working(101)) == Mode::disabled);
  decision.enable(true);
  ModeInput by_controller = working(102);
  by_controller.controller_disables = true;
  CHECK(decision.step(by_controller) == Mode::disabled);
  CHECK(decision.step(working(103)) == Mode::ramping_to_zero);  // stopping
}

TEST_CASE("a stop ramps to zero with and without good data, and keeps the switch", "[mode]") {
  ModeDecision decision(config());
  CHECK(decision.step(working(0)) == Mode::compensating);
  decision.stop();
  CHECK(decision.step(working(1)) == Mode::ramping_to_zero);
  CHECK(decision.step(lost_for(2)) == Mode::ramping_to_zero);
  CHECK(decision.state().enabled);
}

TEST_CASE("mode_since is the time of the last change", "[mode]") {
  ModeDecision decision(config());
  (void)decision.step(working(5));
  (void)decision.step(working(6));
  CHECK(decision.state().mode_since == 5s);
  (void)decision.step(lost_for(7));
  (void)decision.step(lost_for(8));
  CHECK(decision.state().mode_since == 7s);
}

TEST_CASE("a reload continues in the same mode, with the time already lost", "[mode]") {
  ModeDecision before(config(LossPolicy::ramp_to_zero));
  (void)before.step(working(0));
  (void)before.step(lost_for(9));
  ModeDecision after(config(LossPolicy::ramp_to_zero));
  after.adopt(before);
  CHECK(after.state().mode == Mode::holding);
  CHECK(after.state().mode_since == 9s);
  CHECK(after.step(lost_for(11)) == Mode::ramping_to_zero);
}
