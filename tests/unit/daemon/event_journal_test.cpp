// What happened, in order and with how long it lasted, in a time of the test's own.
#include "daemon/status/event_journal.hpp"

#include <catch2/catch.hpp>

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

struct Bench {
  std::chrono::nanoseconds monotonic{1000s};
  std::chrono::nanoseconds wall{1'700'000'000s};
  EventJournal journal{[this] { return EventJournal::Moment{monotonic, wall}; }};
  void pass(std::chrono::nanoseconds time) {
    monotonic += time;
    wall += time;
  }
};

}  // namespace

TEST_CASE("an outage is a fault, a recovery, and how long it lasted", "[daemon][events]") {
  Bench bench;
  bench.journal.fault("sensor bed", "no_answer");
  bench.pass(2s);
  bench.journal.fault("sensor bed", "no_answer");  // nothing new
  bench.journal.recovery("sensor table");          // never was bad
  REQUIRE(bench.journal.events().size() == 1);
  bench.journal.fault("sensor bed", "stale");
  bench.pass(26s);
  bench.journal.recovery("sensor bed");
  bench.journal.recovery("sensor bed");
  const auto& events = bench.journal.events();
  REQUIRE(events.size() == 3);
  CHECK(events[0].kind == "fault");
  CHECK(events[1].what == "stale");
  CHECK(events[2].kind == "recovery");
  CHECK(events[2].what == "stale");
  CHECK(events[2].duration_s == Approx(28.0));  // from the first fault on
  CHECK(events[2].number == 3);
  CHECK(events[2].wall_ns == (1'700'000'028s / 1ns));
}

TEST_CASE("a fault that comes and goes is one outage of four events", "[daemon][events]") {
  Bench bench;
  int told = 0;
  for (int i = 0; i < 1200; ++i) {  // four times a second for five minutes
    told += bench.journal.fault("sensor bed", i % 4 == 0 ? "no_answer" : "stale") ? 1 : 0;
    bench.pass(125ms);
    CHECK(std::isnan(bench.journal.recovery("sensor bed")) == (i > 0));
    bench.pass(125ms);
    CHECK(bench.journal.settle().empty());
  }
  CHECK(told == 2);
  CHECK(bench.journal.comes_and_goes("sensor bed"));
  bench.pass(9s);
  CHECK(bench.journal.settle().empty());
  bench.pass(1s);
  const auto ended = bench.journal.settle();
  REQUIRE(ended.size() == 1);
  CHECK(ended[0].kind == "recovery");
  CHECK(ended[0].duration_s == Approx(300.0).margin(0.2));  // to where it went away
  CHECK_FALSE(bench.journal.lasts("sensor bed"));
  const auto& events = bench.journal.events();
  REQUIRE(events.size() == 4);
  CHECK(events[0].what == "no_answer");
  CHECK(events[1].kind == "recovery");
  CHECK(events[2].what == "stale, comes and goes");
  // What comes later is another outage.
  bench.pass(60s);
  CHECK(bench.journal.fault("sensor bed", "no_answer"));
  bench.pass(1s);
  CHECK(bench.journal.recovery("sensor bed") == Approx(1.0));
}

TEST_CASE("each kind of fault is told once in an outage", "[daemon][events]") {
  Bench bench;
  for (int i = 0; i < 1000; ++i) {
    bench.journal.fault("sensor bed", i % 2 == 0 ? "no_answer" : "stale");
    bench.journal.fault("bus a", "error " + std::to_string(i));
    bench.pass(250ms);
  }
  CHECK(bench.journal.events().size() == 2 + EventJournal::faults_of_outage_max);
  CHECK(bench.journal.recovery("sensor bed") == Approx(250.0));
}

TEST_CASE("a clock that is set changes no duration", "[daemon][events]") {
  Bench bench;
  bench.journal.mode("compensating");
  bench.pass(60s);
  bench.wall -= 24h;
  bench.journal.mode("compensating");
  bench.journal.mode("holding");
  const auto& events = bench.journal.events();
  REQUIRE(events.size() == 2);
  CHECK(std::isnan(events[0].duration_s));
  CHECK(events[1].subject == "compensating");
  CHECK(events[1].what == "holding");
  CHECK(events[1].duration_s == Approx(60.0));
}

TEST_CASE("what ended lately is told, newest first", "[daemon][events]") {
  Bench bench;
  for (const char* subject : {"bus a", "bus b", "bus c"}) {
    bench.journal.fault(subject, "refused");
    bench.pass(100s);
    bench.journal.recovery(subject);
  }
  bench.journal.command("disable", 1000);
  bench.pass(30s);
  const auto ended = bench.journal.ended_within(150s, 5);
  REQUIRE(ended.size() == 2);
  CHECK(ended[0].subject == "bus c");
  CHECK(ended[1].subject == "bus b");
  CHECK(bench.journal.ended_within(1h, 1).size() == 1);
  CHECK(bench.journal.events().back().user == 1000);
}

TEST_CASE("the journal is bounded", "[daemon][events]") {
  Bench bench;
  for (std::size_t i = 0; i < EventJournal::kept_max + 10; ++i)
    bench.journal.command(std::to_string(i), 0);
  CHECK(bench.journal.events().size() == EventJournal::kept_max);
  CHECK(bench.journal.events().front().what == "10");
}
