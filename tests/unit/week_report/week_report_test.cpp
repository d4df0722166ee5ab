#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "cli/report/machine_week.hpp"
#include "cli/report/week_page.hpp"
#include "daemon/history/replay/replay.hpp"
#include "history_fixture.hpp"

namespace {

using namespace thermocomp;
using namespace thermocomp::cli;
using namespace thermocomp::testing;
using Catch::Matchers::Contains;

constexpr double day_s = 86400.0;
constexpr double begin_s = 1.8e9;

RecordedEvent event_at(double since_begin_s, const std::string& kind, const std::string& subject,
                       const std::string& what, std::int64_t run = 1) {
  RecordedEvent event;
  event.run = run;
  event.wall_ns = std::llround((begin_s + since_begin_s) * 1e9);
  event.kind = kind;
  event.subject = subject;
  event.what = what;
  return event;
}

double spell_s(const std::vector<ModeSpell>& spells, const std::string& mode) {
  double sum = 0.0;
  for (const ModeSpell& spell : spells)
    if (spell.mode == mode) sum += spell.span.length_s();
  return sum;
}

/// Temperatures of a day's course, one point in ten minutes, with noise.
ThinnedHistory week_of_sensors(double drift_K, std::uint64_t seed) {
  ThinnedHistory course;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 0.1);
  course.columns = {{"bed_degC", {}}, {"column_degC", {}}, {"oil_degC", {}}};
  for (int i = 0; i < 7 * 144; ++i) {
    const double day = i / 144.0;
    const double course_K = 4.0 * std::sin(6.2832 * day) + std::sin(6.2832 * day / 3.1);
    course.time_s.push_back(begin_s + day * day_s);
    course.columns[0].values.push_back(22.0 + course_K + noise(random));
    course.columns[1].values.push_back(23.0 + 0.8 * course_K + drift_K * (day / 7.0 - 0.5) +
                                       noise(random));
    course.columns[2].values.push_back(30.0 + 3.0 * std::cos(17.0 * day) + noise(random));
  }
  return course;
}

}  // namespace

TEST_CASE("hours of each mode are those between its events, cut at the span and at a run's end",
          "[week]") {
  const WeekEvents events{
      {event_at(-3600, "mode", "", "starting"), event_at(0, "mode", "starting", "compensating"),
       event_at(7200, "mode", "compensating", "holding"),
       event_at(7800, "mode", "holding", "compensating"),
       event_at(20000, "mode", "", "disabled", 2)},
      {{1, begin_s + 10800}, {2, begin_s + 50000}}};
  const auto spells = mode_spells(events, {begin_s - 600, begin_s + 30000});
  CHECK(spell_s(spells, "starting") == Approx(600.0).margin(1e-3));
  CHECK(spell_s(spells, "compensating") == Approx(7200.0 + 3000.0).margin(1e-3));
  CHECK(spell_s(spells, "holding") == Approx(600.0).margin(1e-3));
  CHECK(spell_s(spells, "disabled") == Approx(10000.0).margin(1e-3));
}

TEST_CASE("outages count and last until their recovery, or the run's end", "[week]") {
  const WeekEvents events{
      {event_at(0, "fault", "sensor bed", "stale"), event_at(30, "fault", "bus cabinet", "timeout"),
       event_at(60, "recovery", "sensor bed", "stale"),
       event_at(500, "fault", "sensor bed", "open_circuit"),
       event_at(600, "recovery", "sensor bed", "open_circuit")},
      {{1, begin_s + 1000}}};
  const auto outages = outages_of(events, {begin_s, begin_s + 1000});
  REQUIRE(outages.size() == 2);
  CHECK(outages[0].subject == "bus cabinet");
  CHECK(outages[0].lasted_s == Approx(970.0).margin(1e-3));
  CHECK(outages[0].lasts);
  CHECK(outages[1].count == 2);
  CHECK(outages[1].lasted_s == Approx(160.0).margin(1e-3));
  CHECK_FALSE(outages[1].lasts);
}

TEST_CASE("a sensor's drift against its neighbour is within its interval of the truth", "[week]") {
  int within = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto sensors = sensors_of(week_of_sensors(1.5, seed));
    REQUIRE(sensors.size() == 3);
    CHECK(sensors[1].neighbour == "bed");
    CHECK(sensors[2].neighbour.empty());
    if (std::abs(sensors[1].drift_K - 1.5) < 2.0 * sensors[1].drift_sd_K) ++within;
    CHECK(sensors[1].drift_sd_K < 0.3);
  }
  CHECK(within >= 19);
}

TEST_CASE("what to do: a drifting sensor is named, a steady one is not", "[week]") {
  MachineWeek week;
  week.span = {begin_s, begin_s + 7 * day_s};
  week.course = week_of_sensors(2.0, 3);
  week.sensors = sensors_of(week.course);
  std::vector<std::string> lines = advice(week);
  REQUIRE_FALSE(lines.empty());
  CHECK_THAT(lines[0], Contains("drifted by") && Contains("thermometer"));
  week.course = week_of_sensors(0.0, 3);
  week.sensors = sensors_of(week.course);
  CHECK(advice(week).empty());
}

TEST_CASE("a recorded machine: offsets and probings as replay has them", "[week]") {
  const TempFolder folder;
  const auto config = history_config(folder / "h.db");
  const WriterClocks clocks{[] { return nanoseconds(0); },
                            [] { return std::chrono::hours(500000); }};
  const double zero_s = 3600.0 * 500007.0;  // the grid begins at 7 h
  RecordedMachine machine(config, 11, 65536, clocks);
  machine.start();
  machine.run(12000);  // two minutes
  std::int64_t number = 0;
  const auto at = [&](double since_s, const char* kind, const char* subject, const char* what) {
    RecordedEvent event = event_at(0, kind, subject, what);
    event.number = ++number;
    event.wall_ns = std::llround((zero_s + since_s) * 1e9);
    machine.writer().note(event);
  };
  at(0.0, "mode", "", "compensating");
  at(60.0, "command", "", "measured z 2.5 um");
  at(90.0, "mode", "compensating", "disabled");
  machine.stop();

  std::vector<double> z_um;
  double at_probing_um = 0.0;
  std::size_t near = 0;
  const auto note = [&](const ReplayedOffsets& offsets) {
    z_um.push_back(offsets.recorded_um[1]);
    if (std::abs(offsets.time_s - 60.0) > 2.0) return;
    at_probing_um += offsets.recorded_um[1];
    ++near;
  };
  static_cast<void>(replay(config.file, note, {}, parse_test_setup));
  const WallSpan span = recorded_span(config.file);
  CHECK(span.from_s == Approx(zero_s).margin(0.1));
  const MachineWeek week = machine_week(config.file, span, parse_test_setup);
  CHECK(week.recorded_s == Approx(120.0).margin(1.0));
  CHECK(week.mode_s("compensating") == Approx(90.0).margin(0.5));
  CHECK(week.mode_s("disabled") == Approx(30.0).margin(1.0));
  REQUIRE(week.axes.size() == 2);
  const auto [low, high] = std::minmax_element(z_um.begin(), z_um.end());
  CHECK(week.axes[1].low_um == Approx(*low).margin(0.1 * (*high - *low) + 0.5));
  CHECK(week.axes[1].high_um == Approx(*high).margin(0.1 * (*high - *low) + 0.5));
  REQUIRE(week.probings.size() == 1);
  CHECK(week.probings[0].left_um == 2.5);
  CHECK(week.probings[0].claimed_um ==
        Approx(-at_probing_um / static_cast<double>(near)).margin(0.3));
  const std::string html = week_html(week);
  CHECK_THAT(html, Contains("What to do") && Contains("2.50 µm"));
  CHECK(html.find("http") == std::string::npos);
}
