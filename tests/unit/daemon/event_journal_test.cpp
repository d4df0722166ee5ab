// The event journal, with a clock set by the test.
#include "daemon/status/event_journal.hpp"

#include <catch2/catch.hpp>

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

const Subject bed{SubjectKind::sensor, "bed"};

struct Journal {
  std::chrono::nanoseconds monotonic{1000s};
  std::chrono::nanoseconds wall{1'700'000'000s};
  EventJournal journal{[this] { return EventJournal::Moment{monotonic, wall}; }};
  void pass(std::chrono::nanoseconds time) {
    monotonic += time;
    wall += time;
  }
};

}  // namespace

TEST_CASE("an outage has a fault, a recovery and a duration", "[daemon][events]") {
  Journal bench;
  bench.journal.fault({.subject = bed, .code = "no_answer"});
  bench.pass(2s);
  bench.journal.fault({.subject = bed, .code = "no_answer"});  // repeated
  bench.journal.recovery({SubjectKind::sensor, "table"});      // had no fault
  REQUIRE(bench.journal.events().size() == 1);
  bench.journal.fault({.subject = bed, .code = "stale"});
  bench.pass(26s);
  bench.journal.recovery(bed);
  bench.journal.recovery(bed);
  const auto& events = bench.journal.events();
  REQUIRE(events.size() == 3);
  CHECK(events[0].kind == EventKind::fault);
  CHECK(events[1].code == "stale");
  CHECK(events[2].kind == EventKind::recovery);
  CHECK(events[2].code == "stale");
  CHECK(events[2].duration_s == Approx(28.0));  // since the first fault
  CHECK(events[2].number == 3);
  CHECK(events[2].wall_s == 1'700'000'028.0);
}

TEST_CASE("an intermittent fault is one outage of four events", "[daemon][events]") {
  Journal bench;
  int message = 0;
  for (int i = 0; i < 1200; ++i) {  // 4 Hz for five minutes
    message +=
        bench.journal.fault({.subject = bed, .code = i % 4 == 0 ? "no_answer" : "stale"}) ? 1 : 0;
    bench.pass(125ms);
    CHECK(std::isnan(bench.journal.recovery(bed)) == (i > 0));
    bench.pass(125ms);
    CHECK(bench.journal.settle().empty());
  }
  CHECK(message == 2);
  CHECK(bench.journal.comes_and_goes(bed));
  bench.pass(9s);
  CHECK(bench.journal.settle().empty());
  bench.pass(1s);
  const auto ended = bench.journal.settle();
  REQUIRE(ended.size() == 1);
  CHECK(ended[0].kind == EventKind::recovery);
  CHECK(ended[0].duration_s == Approx(300.0).margin(0.2));  // to its last end
  CHECK_FALSE(bench.journal.lasts(bed));
  const auto& events = bench.journal.events();
  REQUIRE(events.size() == 4);
  CHECK(events[0].code == "no_answer");
  CHECK(events[1].kind == EventKind::recovery);
  CHECK(what_text(events[2]) == "stale, comes and goes");
  // A later fault is another outage.
  bench.pass(60s);
  CHECK(bench.journal.fault({.subject = bed, .code = "no_answer"}));
  bench.pass(1s);
  CHECK(bench.journal.recovery(bed) == Approx(1.0));
}

TEST_CASE("each kind of fault is reported once per outage", "[daemon][events]") {
  Journal bench;
  for (int i = 0; i < 1000; ++i) {
    bench.journal.fault({.subject = bed, .code = i % 2 == 0 ? "no_answer" : "stale"});
    bench.journal.fault({.subject = {SubjectKind::bus, "a"}, .code = std::to_string(i)});
    bench.pass(250ms);
  }
  CHECK(bench.journal.events().size() == 2 + EventJournal::faults_of_outage_max);
  CHECK(bench.journal.recovery(bed) == Approx(250.0));
}

TEST_CASE("setting the clock does not change durations", "[daemon][events]") {
  Journal bench;
  bench.journal.mode("compensating");
  bench.pass(60s);
  bench.wall -= 24h;
  bench.journal.mode("compensating");
  bench.journal.mode("holding");
  const auto& events = bench.journal.events();
  REQUIRE(events.size() == 2);
  CHECK(std::isnan(events[0].duration_s));
  CHECK(events[1].subject.name == "compensating");
  CHECK(events[1].code == "holding");
  CHECK(events[1].duration_s == Approx(60.0));
}

TEST_CASE("recently ended outages are reported, newest first", "[daemon][events]") {
  Journal bench;
  for (const char* name : {"a", "b", "c"}) {
    const Subject subject{SubjectKind::bus, name};
    bench.journal.fault({.subject = subject, .code = "not_connected", .detail = "refused"});
    bench.pass(100s);
    bench.journal.recovery(subject);
  }
  bench.journal.command({.code = "disable", .user = 1000});
  bench.pass(30s);
  const auto ended = bench.journal.ended_within(150s, 5);
  REQUIRE(ended.size() == 2);
  CHECK(ended[0].subject.name == "c");
  CHECK(ended[1].subject.name == "b");
  CHECK(bench.journal.ended_within(1h, 1).size() == 1);
  CHECK(bench.journal.events().back().user == 1000);
}

TEST_CASE("the journal is bounded", "[daemon][events]") {
  Journal bench;
  for (std::size_t i = 0; i < EventJournal::kept_max + 10; ++i)
    bench.journal.command({.code = std::to_string(i)});
  CHECK(bench.journal.events().size() == EventJournal::kept_max);
  CHECK(bench.journal.events().front().code == "10");
}
