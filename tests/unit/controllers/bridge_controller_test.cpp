// The bridge link and its reports, in virtual time.
#include "drivers/controllers/kinds/bridge_controller.hpp"

#include <chrono>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

nanoseconds test_now{};
nanoseconds now_of_test() noexcept {
  return test_now;
}

struct Bench {
  Bench() : link({"mill", 1.0, {"x", "z"}, {"x_mm"}}, now_of_test) {
    test_now = 1000s;
    link.start();
    reported.session = 7;
    reported.taking = true;
    reported.applied_um[0] = 5.0;
    reported.applied_um[1] = -3.0;
    reported.signals[0] = 120.0;
  }
  BridgeAnswer report() {
    test_now += 50ms;
    const auto answer = link.report(reported);
    REQUIRE(answer);
    return *answer;
  }
  ControllerState state() {
    ControllerState newest;
    link.newest(newest);
    return newest;
  }
  /// As a cycle does, with the newest epoch.
  void want(double x_um, double z_um) {
    OffsetCommand command;
    command.link_epoch = state().link_epoch;
    command.read_back_number = state().read_back_number;
    command.offset_um = {x_um, z_um};
    command.valid = {true, true};
    link.offer(command);
  }

  BridgeController link;
  BridgeReport reported;
};

}  // namespace

TEST_CASE("the answer to a report is the newest command", "[controllers][bridge]") {
  Bench bench;
  CHECK_FALSE(bench.state().online);
  const BridgeAnswer first = bench.report();
  CHECK(first.anew);
  CHECK_FALSE(first.valid[0]);
  const ControllerState state = bench.state();
  CHECK(state.online);
  CHECK(state.link_epoch == 1);
  CHECK(state.applied_um[1] == -3.0);
  CHECK(state.signals[0] == 120.0);
  bench.want(5.5, -3.5);
  const BridgeAnswer second = bench.report();
  CHECK_FALSE(second.anew);
  CHECK(second.valid[0]);
  CHECK(second.offset_um[0] == 5.5);
  CHECK(second.offset_um[1] == -3.5);
  CHECK_FALSE(second.valid[2]);  // no such axis in this configuration
  CHECK(bench.link.health().writes == 1);
}

TEST_CASE("a silent bridge is offline and begins a new epoch on its return",
          "[controllers][bridge]") {
  Bench bench;
  bench.report();
  bench.want(5.0, -3.0);
  CHECK(bench.report().valid[0]);
  test_now += 1001ms;
  CHECK_FALSE(bench.state().online);
  CHECK_FALSE(bench.link.health().connected);
  const BridgeAnswer back = bench.report();
  CHECK(back.anew);
  CHECK_FALSE(back.valid[0]);  // offsets from before the silence are not sent
  CHECK(bench.state().link_epoch == 2);
  CHECK(bench.state().online);
}

TEST_CASE("offsets from before a re-homing are not sent after it", "[controllers][bridge]") {
  Bench bench;
  bench.report();
  bench.want(5.0, -3.0);
  bench.report();
  bench.reported.applied_um[0] = 0.0;
  const BridgeAnswer answer = bench.report();
  CHECK_FALSE(answer.anew);  // the bridge keeps its offset: the same link
  CHECK_FALSE(answer.valid[0]);
  CHECK(bench.state().link_epoch == 1 + epochs_of_a_link);
}

TEST_CASE("a bridge that reads back twice the offset sent gets no more offsets",
          "[controllers][bridge]") {
  Bench bench;
  bench.report();
  for (double offset_um = 5.0; offset_um < 9.0; offset_um += 0.2) {
    bench.want(offset_um, -3.0);
    CHECK_FALSE(bench.report().anew);
    bench.reported.applied_um[0] = 2.0 * offset_um;
  }
}

TEST_CASE("a controller that takes no offsets is online and not synchronised",
          "[controllers][bridge]") {
  Bench bench;
  bench.report();
  bench.want(5.0, -3.0);
  bench.report();
  bench.reported.taking = false;
  bench.reported.applied_um[0] = 0.0;
  const BridgeAnswer off = bench.report();
  CHECK(off.anew);
  CHECK_FALSE(off.valid[0]);
  CHECK(bench.state().online);
  CHECK(std::isnan(bench.state().applied_um[0]));
  CHECK(bench.state().signals[0] == 120.0);
  bench.want(5.0, -3.0);
  CHECK_FALSE(bench.report().valid[0]);
  CHECK_FALSE(bench.report().anew);  // still off: no new link
  bench.reported.taking = true;
  CHECK(bench.report().anew);
  CHECK(bench.state().applied_um[0] == 0.0);
}

TEST_CASE("an axis with unknown applied offset is not synchronised", "[controllers][bridge]") {
  Bench bench;
  bench.reported.applied_um[1] = not_a_number;
  bench.report();
  bench.want(1.0, 1.0);
  CHECK_FALSE(bench.report().valid[0]);
  CHECK(std::isnan(bench.state().applied_um[0]));
}

TEST_CASE("of two bridges the first is accepted until it is silent", "[controllers][bridge]") {
  Bench bench;
  bench.report();
  BridgeReport other = bench.reported;
  other.session = 8;
  CHECK_FALSE(bench.link.report(other));
  CHECK(bench.link.health().read_errors == 1);
  CHECK_FALSE(bench.report().anew);
  test_now += 1100ms;
  const auto taken = bench.link.report(other);
  REQUIRE(taken);
  CHECK(taken->anew);
  CHECK(bench.link.health().connects == 2);
}

TEST_CASE("offsets count as written with the bridge's next report", "[controllers][bridge]") {
  Bench bench;
  const auto written = [&] {
    ControllerState state;
    bench.link.newest(state);
    return state.written;
  };
  bench.report();
  bench.want(5.0, -3.0);
  REQUIRE(bench.report().valid[0]);
  CHECK_FALSE(written());  // answered, not yet confirmed
  bench.report();
  CHECK(written());
  for (int i = 0; i < 70; ++i) bench.report();  // the cycle hangs
  CHECK_FALSE(written());
}

TEST_CASE("offsets of a hung cycle are not sent for ever", "[controllers][bridge]") {
  Bench bench;
  bench.report();
  bench.want(5.0, -3.0);
  CHECK(bench.report().valid[0]);
  for (int i = 0; i < 40; ++i) bench.report();
  CHECK_FALSE(bench.report().valid[0]);  // more than two seconds old
}

TEST_CASE("an invalid configuration is refused at the start", "[controllers][bridge]") {
  CHECK_THROWS_AS(BridgeController({"m", 0.0, {"x"}, {}}), InvalidValue);
  CHECK_THROWS_AS(BridgeController({"m", 1.0, std::vector<std::string>(17, "x"), {}}),
                  InvalidValue);
}
