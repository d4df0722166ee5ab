// Events from reports, with a clock set by the test.
#include "daemon/status/event_log.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include <catch2/catch.hpp>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

struct Bench {
  std::chrono::nanoseconds monotonic{1000s};
  EventJournal journal{[this] { return EventJournal::Moment{monotonic, 1'700'000'000s}; }};
  EventLog log{journal};
  EstimatorConfig config;
  Report report;

  Bench() {
    config.sensors.resize(2);
    config.sensors[0].name = "bed";
    config.sensors[1].name = "head";
    report.sensors.resize(2);
    report.mode = Mode::compensating;
    pass(10s);
  }
  void pass(std::chrono::nanoseconds time) {
    monotonic += time;
    report.now = monotonic;
    log.note_report(report, config);
  }
  [[nodiscard]] std::vector<Event> about(const std::string& subject) const {
    std::vector<Event> found;
    for (const Event& event : journal.events())
      if (subject_text(event.subject) == subject) found.push_back(event);
    return found;
  }
};

}  // namespace

TEST_CASE("a suspected sensor is a fault with its size, and recovers", "[daemon][events]") {
  Bench bench;
  bench.report.sensors[1].suspected = true;
  bench.report.sensors[1].suspected_size_K = -2.04;
  bench.report.reasons = static_cast<std::uint32_t>(Reason::sensor_suspected);
  bench.pass(1s);
  bench.report.sensors[1].suspected_size_K = -2.4;  // the same error, re-estimated: no event
  bench.pass(59s);
  bench.report.sensors[1].suspected = false;
  bench.report.reasons = 0;
  bench.pass(1s);
  const auto reported = bench.about("suspected sensor head");
  REQUIRE(reported.size() == 2);
  CHECK(reported[0].kind == EventKind::fault);
  CHECK(what_text(reported[0]) == "off by -2.0 K against its neighbours");
  CHECK(reported[1].kind == EventKind::recovery);
  CHECK(reported[1].duration_s == Approx(60.0));
  CHECK(bench.about("suspected sensor bed").empty());
  const auto reason = bench.about("reason sensor_suspected");
  REQUIRE(reason.size() == 2);
  CHECK(reason[1].duration_s == Approx(60.0));
}

TEST_CASE("the end of a sensor's outage has the change over it where that is more than noise",
          "[daemon][events]") {
  const auto [after_degC, change_K] =
      GENERATE(std::pair(23.7, -4.3), std::pair(28.9, not_a_number));
  Bench bench;
  bench.report.sensors[0] = {.raw_degC = 28.0, .fault = Fault::none};
  bench.pass(1s);
  bench.pass(20s);
  bench.report.sensors[0] = {.fault = Fault::no_answer};
  bench.pass(6s);
  bench.report.sensors[0] = {.raw_degC = after_degC, .fault = Fault::unconfirmed, .waiting = true};
  bench.pass(2s);
  bench.report.sensors[0] = {.raw_degC = after_degC, .fault = Fault::none};
  bench.pass(1s);
  const Event end = bench.about("sensor bed").back();
  CHECK(end.kind == EventKind::recovery);
  CHECK(end.code == "no_answer");
  CHECK(end.duration_s == Approx(3.0));
  if (std::isnan(change_K))
    CHECK(std::isnan(end.value));
  else
    CHECK(end.value == Approx(change_K));
}

TEST_CASE("a controller that returns with another offset in effect is an event",
          "[daemon][events]") {
  const auto [after_um, is_named] =
      GENERATE(std::pair(0.0, true), std::pair(19.5, false), std::pair(21.0, false));
  Bench bench;
  bench.config.axes.resize(1);
  bench.config.axes[0].name = "y";
  bench.config.axes[0].output = "y_um";
  bench.report.axes.resize(1);
  bench.report.axes[0].applied_um = 21.0;
  bench.pass(1s);
  bench.report.reasons = static_cast<std::uint32_t>(Reason::controller_offline);
  bench.pass(4s);
  bench.report.reasons = 0;
  bench.report.axes[0].applied_um = after_um;
  bench.pass(1s);
  const auto& events = bench.journal.events();
  const auto named = std::find_if(events.begin(), events.end(), [](const Event& event) {
    return event.kind == EventKind::daemon && event.code == "offset";
  });
  REQUIRE((named != events.end()) == is_named);
  if (is_named)
    CHECK_THAT(event_text(*named), Catch::Contains("+0.00 um in effect, +21.00 before"));
}

TEST_CASE("a frozen module is a fault of its device, and recovers", "[daemon][events]") {
  Bench bench;
  bench.log.note_frozen({{"m1", 60.0}});
  bench.log.note_frozen({{"m1", 75.0}});
  bench.pass(30s);
  bench.log.note_frozen({});
  const auto reported = bench.about("device m1");
  REQUIRE(reported.size() == 2);
  CHECK(reported[0].code == "frozen");
  CHECK(reported[1].duration_s == Approx(30.0));
}

TEST_CASE("a target that oscillates about its bound is one outage", "[daemon][events]") {
  Bench bench;
  for (int i = 0; i < 100; ++i) {
    bench.report.reasons = i % 2 == 0 ? static_cast<std::uint32_t>(Reason::at_bound) : 0u;
    bench.pass(20s);
  }
  REQUIRE(bench.about("reason at_bound").size() == 1);
  bench.pass(40s);
  CHECK(bench.about("reason at_bound").size() == 1);
  bench.pass(20s);
  const auto reported = bench.about("reason at_bound");
  REQUIRE(reported.size() == 2);
  CHECK(reported[1].kind == EventKind::recovery);
  CHECK(reported[1].duration_s == Approx(99 * 20.0));  // to its last end
}

TEST_CASE("a block that is lost and back four times a second makes a few lines per outage",
          "[daemon][events]") {
  std::ostringstream text;
  auto before = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(
      "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(text)));
  Bench bench;
  AxisConfig axis;
  axis.name = "z";
  bench.config.axes.push_back(axis);
  bench.config.compensation.offset_sd_um_max = 1.0;
  bench.report.axes.resize(1);
  bench.report.axes[0].offset_sd_um = 2.0;
  bench.report.inputs.resize(2);
  bench.report.inputs[0].good = bench.report.inputs[1].good = true;
  const auto lost = static_cast<std::uint32_t>(Reason::block_lost);
  for (int i = 0; i < 2400; ++i) {  // ten minutes
    const bool is_lost = i % 2 == 0;
    bench.report.sensors[0].fault = is_lost ? Fault::no_answer : Fault::none;
    bench.report.inputs[0].good = !is_lost;
    bench.report.inputs[0].estimated = i % 4 == 0;
    bench.report.reasons = is_lost ? lost : 0;
    bench.report.mode = is_lost ? Mode::holding : Mode::compensating;
    bench.pass(250ms);
    bench.log.note_estimates(bench.report, bench.config, {"bed_degC", "head_degC"});
  }
  bench.report.inputs[0] = bench.report.inputs[1];
  bench.pass(20s);
  bench.log.note_estimates(bench.report, bench.config, {"bed_degC", "head_degC"});
  spdlog::set_default_logger(before);
  const std::string message = text.str();
  CHECK(std::count(message.begin(), message.end(), '\n') < 30);
  CHECK(message.find("sensor bed: no_answer: over, lasted 600.0 s") != std::string::npos);
  CHECK(bench.journal.events().size() < 30);
  CHECK(bench.journal.events().back().code == "compensating");
}

TEST_CASE("a reason without a limit ends at once", "[daemon][events]") {
  Bench bench;
  bench.report.reasons = static_cast<std::uint32_t>(Reason::block_lost);
  bench.report.mode = Mode::holding;
  bench.pass(1s);
  bench.report.reasons = 0;
  bench.report.mode = Mode::compensating;
  bench.pass(7s);
  const auto reported = bench.about("reason block_lost");
  REQUIRE(reported.size() == 2);
  CHECK(reported[1].duration_s == Approx(7.0));
}

TEST_CASE("failing writes are one outage with its cause, a single failure is none",
          "[daemon][events]") {
  Bench bench;
  ControllerHealth controller;
  controller.name = "plc";
  controller.connected = true;
  controller.write.confirmed_at = 1s;
  bench.log.note_controller(controller);
  controller.write.error = "the controller refuses writes (function 16, register 100)";
  controller.write.confirmed_at = 2s;
  bench.log.note_controller(controller);  // another one was confirmed since the last call
  CHECK(bench.about("writes to controller plc").empty());
  for (int i = 0; i < 10; ++i) {
    bench.monotonic += 1s;
    bench.log.note_controller(controller);
  }
  controller.write.error.clear();
  bench.monotonic += 1s;
  bench.log.note_controller(controller);
  const auto reported = bench.about("writes to controller plc");
  REQUIRE(reported.size() == 2);
  CHECK(what_text(reported[0]) == "the controller refuses writes (function 16, register 100)");
  CHECK(reported[1].kind == EventKind::recovery);
  CHECK(reported[1].duration_s == Approx(10.0));
}
