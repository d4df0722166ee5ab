// Tests of the state of the bridge's pins.
#include "linuxcnc/bridge_state.hpp"

#include <cmath>

#include <catch2/catch.hpp>

using namespace thermocomp_linuxcnc;
using namespace std::chrono_literals;

namespace {

MachineView machine(double applied_mm) {
  MachineView view;
  view.taking = view.enabled = view.homed = true;
  view.spindle_rpm = 0.0;
  view.axes = {{applied_mm, applied_mm, 10.0}};
  return view;
}

Answer offsets(double mm, const char* mode = "compensating") {
  return {false, mode, {mm}};
}

const Answer begin_anew{true, "holding", {std::nullopt}};

struct Bench {
  Outputs answered(const Answer& answer, const MachineView& view) {
    now += 50ms;
    state.take(answer, view, now);
    return state.show(view, now);
  }
  Outputs waited(nanoseconds time, const MachineView& view) {
    now += time;
    return state.show(view, now);
  }
  BridgeState state{1, {}};
  nanoseconds now{100s};
};

}  // namespace

TEST_CASE("an answered offset is shown once, fresh and with a toggled heartbeat", "[linuxcnc]") {
  Bench bench;
  const Outputs none = bench.waited(0s, machine(0.0));
  CHECK_FALSE(none.fresh);
  CHECK(none.warning);
  CHECK_FALSE(none.offset_mm[0]);
  const Outputs first = bench.answered(offsets(0.01), machine(0.01));
  CHECK(first.offset_mm[0] == 0.01);
  CHECK(first.fresh);
  CHECK(first.compensating);
  CHECK_FALSE(first.warning);
  CHECK(first.heartbeat != none.heartbeat);
  const Outputs between = bench.waited(10ms, machine(0.01));
  CHECK_FALSE(between.offset_mm[0]);  // the pin keeps its value
  CHECK(between.heartbeat == first.heartbeat);
}

TEST_CASE("without answers the offset stays, is no longer fresh, and a warning is raised",
          "[linuxcnc]") {
  Bench bench;
  bench.answered(offsets(0.01), machine(0.01));
  const Outputs late = bench.waited(1001ms, machine(0.01));
  CHECK_FALSE(late.fresh);
  CHECK_FALSE(late.compensating);
  CHECK(late.warning);
  CHECK_FALSE(late.offset_mm[0]);
  CHECK_FALSE(bench.waited(3600s, machine(0.01)).offset_mm[0]);
  CHECK_FALSE(bench.answered(offsets(0.01), machine(0.01)).warning);
}

TEST_CASE("an axis without an offset for longer than an answer is fresh is not compensated",
          "[linuxcnc]") {
  const Answer not_driven{false, "compensating", {std::nullopt}, false};
  Bench bench;
  bench.answered(offsets(0.01), machine(0.01));
  CHECK(bench.answered(not_driven, machine(0.01)).compensating);  // one late cycle
  for (int i = 0; i < 20; ++i) bench.answered(not_driven, machine(0.01));
  CHECK_FALSE(bench.answered(not_driven, machine(0.01)).compensating);
  for (int i = 0; i < 60; ++i) bench.answered(not_driven, machine(0.01));
  CHECK(bench.answered(not_driven, machine(0.01)).warning);
}

TEST_CASE("a new epoch starts from the applied offset", "[linuxcnc]") {
  Bench bench;
  CHECK(bench.answered(begin_anew, machine(0.03)).offset_mm[0] == 0.03);
  CHECK(bench.answered(begin_anew, machine(0.5)).offset_mm[0] == 0.2);  // limited to the bound
  CHECK_FALSE(bench.answered(begin_anew, machine(NAN)).offset_mm[0]);
}

TEST_CASE("while no offsets are taken, zero is requested", "[linuxcnc]") {
  Bench bench;
  bench.answered(offsets(0.05), machine(0.05));
  MachineView off = machine(0.0);
  off.taking = false;
  CHECK(bench.waited(1ms, off).offset_mm[0] == 0.0);
  CHECK(bench.answered(offsets(0.05), off).offset_mm[0] == 0.0);
  CHECK_FALSE(bench.waited(1s, machine(0.0)).offset_mm[0]);
}

TEST_CASE("a lasting difference between applied and requested offset is a mismatch", "[linuxcnc]") {
  Bench bench;
  MachineView view = machine(0.02);
  bench.answered(offsets(0.01), view);
  CHECK_FALSE(bench.waited(2900ms, view).mismatch);
  bench.answered(offsets(0.01), view);
  CHECK(bench.waited(200ms, view).mismatch);
  CHECK(bench.waited(1ms, view).warning);
  view.axes[0].applied_mm = 0.01;
  CHECK(bench.waited(1ms, view).mismatch);  // LinuxCNC's setpoint still differs
  view.axes[0].wanted_mm = 0.01;
  CHECK_FALSE(bench.waited(1ms, view).mismatch);
  view.axes[0].applied_mm = NAN;
  bench.waited(1ms, view);
  CHECK(bench.waited(3100ms, view).mismatch);
}

TEST_CASE("a daemon that keeps holding causes a warning, one that is switched off does not",
          "[linuxcnc]") {
  Bench bench;
  for (int i = 0; i < 50; ++i)
    CHECK_FALSE(bench.answered(offsets(0.01, "holding"), machine(0.01)).warning);
  for (int i = 0; i < 20; ++i) bench.answered(offsets(0.01, "holding"), machine(0.01));
  CHECK(bench.answered(offsets(0.01, "holding"), machine(0.01)).warning);
  CHECK_FALSE(bench.answered(offsets(0.01), machine(0.01)).warning);
  for (int i = 0; i < 100; ++i) bench.answered(offsets(0.01, "disabled"), machine(0.01));
  CHECK_FALSE(bench.answered(offsets(0.01, "disabled"), machine(0.01)).warning);
}

TEST_CASE("values that are not numbers are counted", "[linuxcnc]") {
  Bench bench;
  MachineView view = machine(0.0);
  CHECK(bench.waited(1ms, view).faults == 0);
  view.axes[0].position_mm = INFINITY;
  CHECK(bench.waited(1ms, view).faults == 1);
  view.spindle_rpm = NAN;
  CHECK(bench.waited(1ms, view).faults == 3);
}
