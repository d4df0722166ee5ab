#include <catch2/catch.hpp>

#include "cli/observe/watch_text.hpp"

namespace {

using namespace thermocomp::cli;
using Catch::Matchers::Contains;

thermocomp::Status status_at(double uptime_s, double offset) {
  thermocomp::Status status{.uptime_s = uptime_s};
  status.axes = {{.name = "z", .offset = offset}};
  return status;
}

}  // namespace

TEST_CASE("a rising offset shows as rising bars and an arrow", "[trend]") {
  AxisTrends trends(true);
  for (int i = 0; i < 8; ++i) trends.add(status_at(10.0 * i, 0.1 * i));
  CHECK(trends.text("z") == "▁▂▃▄▅▆▇█ ↗");
  CHECK(trends.text("x").empty());
  CHECK_THAT(watch_screen(status_at(80.0, 0.8), nullptr, false, &trends), Contains("▇█ ↗"));
}

TEST_CASE("small changes stay flat, and plain terminals get letters", "[trend]") {
  AxisTrends trends(false);
  for (int i = 0; i < 4; ++i) trends.add(status_at(60.0 * i, i % 2 == 0 ? 1.0 : 1.01));
  CHECK(trends.text("z") == "---- steady");
  trends.add(status_at(240.0, -20.0));
  CHECK_THAT(trends.text("z"), Contains("falling fast"));
}

TEST_CASE("values older than the window or of an earlier daemon are dropped", "[trend]") {
  AxisTrends trends(true);
  trends.add(status_at(0.0, 100.0));
  trends.add(status_at(601.0, 1.0));
  CHECK(trends.text("z").empty());
  trends.add(status_at(610.0, 1.0));
  CHECK_THAT(trends.text("z"), Contains("→"));
  trends.add(status_at(5.0, 1.0));
  CHECK(trends.text("z").empty());
}
