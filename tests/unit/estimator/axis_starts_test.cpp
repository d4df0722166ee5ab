// Without read-back: source of the offset sent last, and when an axis is not driven.
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include <catch2/catch.hpp>

#include "axis_bench.hpp"

using namespace thermocomp;
using namespace thermocomp::test;
using namespace std::chrono_literals;

namespace {

/// A controller without read-back. NaN: its registers cannot be read either.
struct Unread : Bench {
  explicit Unread(double register_um, const SentBefore& before = {}) : Bench(false) {
    obeys = false;
    bank.restore(0, before);
    input.applied_um = register_um;
  }
  void reconnect(nanoseconds away, double register_um) {
    input.now += away;
    input.taken_at = input.now;
    ++input.link_epoch;
    input.applied_um = register_um;
  }
  void save() { bank.saved(0, axis().offset_um()); }
};

constexpr double none = not_a_number;

}  // namespace

TEST_CASE("written registers give the start of an axis", "[start]") {
  const SentBefore before = GENERATE(SentBefore{}, SentBefore{none, false, 8.4},
                                     SentBefore{7.5, true, none}, SentBefore{-30.0, false, none});
  Unread bench(8.0, before);
  bench.step(30.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().start() == StartEvidence::registers);
  CHECK(bench.axis().offset_um() == Approx(8.2));
  CHECK(std::isnan(bench.axis().applied_um()));
  CHECK(std::isnan(bench.axis().corridor_um()));
  bench.steps(100, 30.0);
  CHECK(bench.axis().offset_um() == Approx(28.2));
}

TEST_CASE("registers that contradict the offset sent are not followed", "[start]") {
  // A device may answer 0 for write-only registers.
  const SentBefore before = GENERATE(SentBefore{none, false, -15.0}, SentBefore{-15.0, true, none});
  Unread bench(0.0, before);
  bench.steps(20, 30.0);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().start_unknown());
  CHECK(bench.axis().start() == StartEvidence::unknown);
  CHECK_FALSE(bench.axis().last_offset_unknown());
  CHECK_FALSE(bench.bank.synced());
  bench.reconnect(100ms, 0.0);
  bench.steps(20, 30.0);
  CHECK_FALSE(bench.axis().driven());
  bench.reconnect(100ms, -15.0);
  bench.step(-15.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == -15.0);
}

TEST_CASE("a write that was unconfirmed until the end is no contradiction", "[start]") {
  Unread bench(10.0, {none, false, 15.0});  // 2.5 s behind at its slew limit
  bench.step(10.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 10.0);
}

TEST_CASE("without registers an axis starts from the record, else from the state file", "[start]") {
  Unread by_record(none, {7.6, true, 8.0});
  by_record.step(8.0);
  CHECK(by_record.axis().driven());
  CHECK(by_record.axis().offset_um() == 8.0);
  CHECK(by_record.axis().start() == StartEvidence::record);
  Unread by_file(none, {7.6, true, none});
  by_file.step(7.6);
  CHECK(by_file.axis().driven());
  CHECK(by_file.axis().offset_um() == 7.6);
  CHECK(by_file.axis().start() == StartEvidence::corridor);
}

TEST_CASE("with an unknown start an axis is not driven until released", "[start]") {
  // Any file may hold an offset, but only with a corridor is it a start.
  const SentBefore before =
      GENERATE(SentBefore{}, SentBefore{8.0, false, none}, SentBefore{none, true, none},
               SentBefore{300.0, true, -499.0}, SentBefore{50.1, true, none});
  Unread bench(none, before);
  bench.steps(20, 30.0);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().start_unknown());
  CHECK(bench.axis().last_offset_unknown());
  CHECK(std::abs(bench.axis().offset_um()) <= 50.0);
  bench.release();
  CHECK(bench.axis().start() == StartEvidence::released);
  CHECK(bench.axis().offset_um() == 0.0);
  CHECK_FALSE(bench.axis().driven());  // until the state is on disk
  bench.save();
  bench.steps(100, 30.0);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(1.0));
  CHECK(bench.axis().waits_for_disk());
}

TEST_CASE("a register beyond the bound gives no start", "[start]") {
  Unread bench(50.5);
  bench.steps(5, 0.0);
  CHECK(bench.axis().start_unknown());
  CHECK(bench.axis().out_of_bound());
  bench.release();
  bench.step(0.0);
  CHECK(bench.axis().driven());
  CHECK_FALSE(bench.axis().out_of_bound());
  CHECK(bench.axis().offset_um() == 0.0);
}

TEST_CASE("without registers an offset stays within reach of each that may be on disk",
          "[start][property]") {
  std::mt19937 random(GENERATE(range(0u, 50u)));
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  Unread bench(none, {5.0, true, none});
  double on_disk_um = 5.0;
  double written_um = 5.0;  // being written to disk
  double waiting_um = none;
  double farthest_um = 0.0;
  for (int i = 0; i < 3000; ++i) {
    bench.step(random() % 8 == 0 ? between(-40.0, 40.0) : bench.input.target_um);
    const double offset_um = bench.axis().offset_um();
    CHECK(std::abs(offset_um - on_disk_um) <= 1.0 + 1e-9);
    CHECK(std::abs(offset_um - written_um) <= 1.0 + 1e-9);
    farthest_um = std::max(farthest_um, std::abs(offset_um - 5.0));
    if (random() % 3 == 0) waiting_um = offset_um;
    if (random() % 6 != 0) continue;
    bench.bank.saved(0, on_disk_um = written_um);
    if (std::isfinite(waiting_um)) written_um = std::exchange(waiting_um, none);
  }
  CHECK(farthest_um > 2.0);  // and it moves on
}

TEST_CASE("a state saved before a release does not draw the axis back", "[start]") {
  Unread bench(none);
  bench.steps(3, 0.0);
  bench.release();
  bench.bank.saved(0, -15.0);
  bench.steps(3, -30.0);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().offset_um() == 0.0);
}

TEST_CASE("a controller that was away continues from its registers", "[start]") {
  Unread bench(0.0);
  bench.steps(50, -15.0);
  REQUIRE(bench.axis().offset_um() == Approx(-10.0));
  SECTION("it has kept them") {
    bench.reconnect(10s, -10.0);
    bench.step(-15.0);
    CHECK(bench.axis().offset_um() == Approx(-10.2));
  }
  SECTION("it has restarted") {
    bench.reconnect(3s, 0.0);
    bench.step(-15.0);
    CHECK(bench.axis().driven());
    CHECK(bench.axis().offset_um() == Approx(-0.2));
  }
  SECTION("somebody else has written them") {
    bench.reconnect(3s, 20.0);
    bench.step(-15.0);
    CHECK_FALSE(bench.axis().driven());
    CHECK(bench.axis().start_unknown());
  }
}

TEST_CASE("without registers or read-back, a controller must not have had time to restart",
          "[start]") {
  Unread bench(none, {0.0, true, none});
  bench.step(0.4);
  REQUIRE(bench.axis().offset_um() == Approx(0.2));
  bench.reconnect(800ms, none);
  bench.step(0.4);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(0.4));
  bench.reconnect(3s, none);
  bench.steps(3, 0.4);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().last_offset_unknown());
  bench.release();
  bench.save();
  bench.step(0.4);
  CHECK(bench.axis().driven());
  CHECK(bench.axis().offset_um() == Approx(0.2));
}

TEST_CASE("a controller that was not there when the program began may have restarted too",
          "[start]") {
  for (const double away_s : {1.0, 10.0}) {
    Unread bench(none, {none, false, 5.0});
    bench.input.link_epoch = 0;
    bench.input.online = false;
    for (int i = 0; i < static_cast<int>(10 * away_s); ++i) {
      bench.input.now += 100ms;
      bench.read_back();
    }
    bench.input.link_epoch = 1;
    bench.input.online = true;
    bench.step(5.0);
    INFO(away_s << " s");
    CHECK(bench.axis().start_unknown() == (away_s > 3.0));
    CHECK(bench.axis().start() == (away_s > 3.0 ? StartEvidence::unknown : StartEvidence::record));
  }
}

TEST_CASE("a controller that was away before anything was sent may have restarted too", "[start]") {
  Unread bench(none, {5.0, true, none});
  bench.input.online = false;  // the link was lost before a cycle has seen it
  bench.steps(3, 0.4);
  REQUIRE(bench.axis().start() == StartEvidence::corridor);
  bench.input.online = true;
  bench.reconnect(3s, none);
  bench.steps(3, 0.4);
  CHECK_FALSE(bench.axis().driven());
  CHECK(bench.axis().start_unknown());
}

TEST_CASE("a release takes all nodes of a travel to zero if the start of one is unknown",
          "[start][travel]") {
  EstimatorConfig config;
  config.controller_reads_back = false;
  for (const double position_mm : {0.0, 500.0}) {
    AxisConfig node = axis_of();
    node.node = TravelNode{"z", "z_mm", position_mm};
    config.axes.push_back(node);
  }
  AxisBank bank(config);
  bank.restore(0, {none, false, -15.0});
  bank.restore(1, {});
  ControllerState controller;
  controller.link_epoch = 1;
  controller.taken_at = 1s;
  controller.written = true;
  const std::array<double, 2> target_um{-15.0, -15.0};
  Targets targets;
  targets.axis_um = target_um;
  OffsetCommand command;
  bank.step({1s, 0.1}, targets, true, controller, command);
  REQUIRE(bank[0].start() == StartEvidence::record);
  REQUIRE(bank[1].start_unknown());
  bank.release(0);
  for (std::size_t node = 0; node < 2; ++node) {
    CHECK(bank[node].start() == StartEvidence::released);
    CHECK(bank[node].offset_um() == 0.0);
  }
}

TEST_CASE("without read-back an offset does not move while nothing can be sent", "[start]") {
  Unread bench(0.0);
  bench.steps(20, -15.0);
  const double sent_um = bench.axis().offset_um();
  bench.input.online = GENERATE(false, true);
  bench.input.written = false;
  bench.input.applied_um = GENERATE_COPY(sent_um, none);
  bench.steps(20, 0.0);  // on_loss = "ramp_to_zero", or writes are refused
  CHECK(bench.axis().offset_um() == sent_um);
  bench.input.online = bench.input.written = true;
  bench.step(0.0);
  CHECK(bench.axis().offset_um() == Approx(sent_um + 0.2));
}

TEST_CASE("a reload keeps the source of an axis' start", "[start]") {
  Unread bench(none, {5.0, true, none});
  bench.steps(10, 30.0);
  Unread next(none);
  next.input = bench.input;
  next.bank.adopt(bench.bank, {0});
  next.steps(10, 30.0);
  CHECK(next.axis().driven());
  CHECK(next.axis().offset_um() == Approx(6.0));
}
