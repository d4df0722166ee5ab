// Parser and formatter of times in a history.
#include "daemon/history/format/history_time.hpp"

#include <stdexcept>

#include <catch2/catch.hpp>

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

constexpr std::chrono::nanoseconds now = 1'772'350'211s;

std::int64_t wall_ns(const char* text) {
  return parse_history_time(text, now).wall_ns.value();
}

}  // namespace

TEST_CASE("times before now are counted back from the wall clock", "[history][export]") {
  const std::int64_t hours_8 = (now - 8h).count();
  for (const char* text : {"8 hours ago", "8 hour ago", "8h ago", "8 h ago", "-8h", "-8 h",
                           "-480min", "-480 minutes", "480m ago", "-28800s"}) {
    INFO(text);
    CHECK(wall_ns(text) == hours_8);
  }
  CHECK(wall_ns("-1.5d") == (now - 36h).count());
  CHECK(wall_ns("2 weeks ago") == (now - 336h).count());
  CHECK(wall_ns("now") == now.count());
  CHECK(parse_history_time("-8", now).seconds.value() == -8.0);
}

TEST_CASE("a time is in seconds, or of the wall clock", "[history][export]") {
  CHECK(parse_history_time("12.5").seconds.value() == 12.5);
  CHECK(wall_ns("1970-01-02T00:00:00Z") == 86'400'000'000'000);
  CHECK(wall_ns("1970-01-02T01:00+01:00") == 86'400'000'000'000);
  CHECK(wall_ns("1970-01-02 00:00:07-00:30") == 88'207'000'000'000);
  CHECK(wall_ns("2026-03-01") > 0);
}

TEST_CASE("an invalid time is refused with the valid forms", "[history][export]") {
  const auto text =
      GENERATE(as<std::string>(), "8 hours", "ago", " ago", "-h", "-0h", "-8 fortnights", "h ago",
               "-8hh", "-1e300d", "-nan h", "- 8h ago", "8 hours ago ago", "", "yesterday", "nan",
               "2026-13-01", "2026-02-31", "2026-03-01T25:00", "2026-03-01T08:30:00+1", "12 s",
               "2026-03-01Z", "1969-12-31");
  INFO(text);
  CHECK_THROWS_AS(parse_history_time(text, now), std::invalid_argument);
  CHECK_THROWS_WITH(parse_history_time(text, now), Catch::Contains("8 hours ago"));
}

TEST_CASE("a wall time is reported in UTC with milliseconds", "[history][export]") {
  CHECK(utc_text(1'772'350'211'123'456'789) == "2026-03-01T07:30:11.123Z");
  CHECK(utc_text(-1) == "1969-12-31T23:59:59.999Z");
}
