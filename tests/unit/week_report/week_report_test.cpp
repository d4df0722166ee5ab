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

RecordedEvent event_at(double since_begin_s, EventKind kind, const Subject& subject,
                       const std::string& code, std::int64_t run = 1) {
  RecordedEvent event;
  event.run = run;
  event.wall_s = begin_s + since_begin_s;
  event.kind = kind;
  event.subject = subject;
  event.code = code;
  return event;
}

RecordedEvent mode_at(double since_begin_s, const std::string& code, std::int64_t run = 1) {
  return event_at(since_begin_s, EventKind::mode, {}, code, run);
}

RecordedEvent fault_at(double since_begin_s, const Subject& subject, const std::string& code) {
  return event_at(since_begin_s, EventKind::fault, subject, code);
}

RecordedEvent recovery_at(double since_begin_s, const Subject& subject, const std::string& code) {
  return event_at(since_begin_s, EventKind::recovery, subject, code);
}

Event measured_z(double wall_s, double value_um) {
  return {.number = 1,
          .wall_s = wall_s,
          .kind = EventKind::command,
          .subject = {SubjectKind::axis, "z"},
          .code = "measured",
          .value = value_um};
}

const Subject bed{SubjectKind::sensor, "bed"};
const Subject cabinet{SubjectKind::bus, "cabinet"};

/// Wall time of the first cycle of a machine with these clocks: its grid starts at 07:00.
constexpr double zero_s = 3600.0 * 500007.0;
const WriterClocks still_clocks{[] { return nanoseconds(0); },
                                [] { return std::chrono::hours(500000); }};
/// Temperatures with a daily cycle and noise, sampled every 10 min.
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

TEST_CASE("time per mode runs between events, clipped to the span and the run's end", "[week]") {
  const WeekEvents events{
      {mode_at(-3600, "starting"), mode_at(0, "compensating"), mode_at(7200, "holding"),
       mode_at(7800, "compensating"), mode_at(20000, "disabled", 2)},
      {{1, begin_s + 10800}, {2, begin_s + 50000}}};
  MachineWeek week;
  week.modes = mode_spells(events, {begin_s - 600, begin_s + 30000});
  CHECK(week.mode_s("starting") == Approx(600.0).margin(1e-3));
  CHECK(week.mode_s("compensating") == Approx(7200.0 + 3000.0).margin(1e-3));
  CHECK(week.mode_s("holding") == Approx(600.0).margin(1e-3));
  CHECK(week.mode_s("disabled") == Approx(10000.0).margin(1e-3));
}

TEST_CASE("time in which an axis is latched is not compensated", "[week]") {
  const Subject z{SubjectKind::axis, "z"};
  const WeekEvents events{
      {mode_at(0, "compensating"), fault_at(100, z, "mismatch_latched"), mode_at(200, "holding"),
       mode_at(300, "compensating"), recovery_at(400, z, "mismatch_latched")},
      {{1, begin_s + 1000}}};
  MachineWeek week;
  week.modes = mode_spells(events, {begin_s, begin_s + 1000});
  CHECK(week.mode_s("compensating") == Approx(700.0).margin(1e-3));
  CHECK(week.mode_s("not_driven") == Approx(200.0).margin(1e-3));
  CHECK(week.mode_s("holding") == Approx(100.0).margin(1e-3));
}

TEST_CASE("outages count and last until their recovery, or the run's end", "[week]") {
  const WeekEvents events{
      {fault_at(0, bed, "stale"), fault_at(30, cabinet, "timeout"), recovery_at(60, bed, "stale"),
       fault_at(500, bed, "open_circuit"), recovery_at(600, bed, "open_circuit")},
      {{1, begin_s + 1000}}};
  const auto outages = outages_of(events, {begin_s, begin_s + 1000});
  REQUIRE(outages.size() == 2);
  CHECK(outages[0].subject == cabinet);
  CHECK(outages[0].lasted_s == Approx(970.0).margin(1e-3));
  CHECK(outages[0].lasts);
  CHECK(outages[1].count == 2);
  CHECK(outages[1].lasted_s == Approx(160.0).margin(1e-3));
  CHECK_FALSE(outages[1].lasts);
}

TEST_CASE("times without a daemon are listed, stopped or not", "[week]") {
  const WeekEvents events{
      {event_at(0, EventKind::daemon, {}, "started"), mode_at(0.4, "compensating"),
       event_at(1000, EventKind::daemon, {}, "stopping"), fault_at(1000, bed, "no_answer"),
       event_at(1100, EventKind::daemon, {}, "started", 2), mode_at(1100.7, "compensating", 2)},
      {{1, begin_s + 1000}, {2, begin_s + 1500}}};
  MachineWeek week;
  week.span = {begin_s, begin_s + 1800.4};
  const std::vector<WallSpan> recorded{{begin_s + 1100, begin_s + 1500}, {begin_s, begin_s + 1000}};
  week.modes = daemon_pauses(events, recorded, week.span);
  REQUIRE(week.modes.size() == 2);
  CHECK(week.mode_s(daemon_stopped) == Approx(100.0).margin(1e-3));
  CHECK(week.mode_s(daemon_ended) == Approx(300.4).margin(1e-3));
  const auto with_full_disk = daemon_pauses(events,
                                            {{begin_s, begin_s + 1000},
                                             {begin_s + 1100, begin_s + 1300},
                                             {begin_s + 1400, begin_s + 1500}},
                                            {begin_s, begin_s + 1500});
  REQUIRE(with_full_disk.size() == 2);
  CHECK(with_full_disk[0].mode == daemon_stopped);
  CHECK(with_full_disk[1].mode == not_recorded);
  // A week that begins while the daemon is stopped.
  const auto from_a_stop =
      daemon_pauses(events, {{begin_s, begin_s + 1000}, {begin_s + 1100, begin_s + 1500}},
                    {begin_s + 1050, begin_s + 1500});
  REQUIRE(from_a_stop.size() == 1);
  CHECK(from_a_stop[0].mode == daemon_stopped);
  for (const ModeSpell& spell : mode_spells(events, week.span)) week.modes.push_back(spell);
  CHECK(outages_of(events, week.span).empty());  // switched off with the daemon
  const std::string html = week_html(week);
  CHECK_THAT(
      html,
      Contains("<td>the daemon was stopped</td><td class=\"line\">1 min 40 s</td><td "
               "class=\"line\">5.5 %</td>") &&
          Contains(
              "was stopped (power cut, crash, disk full)</td><td class=\"line\">5 min 0 s</td>") &&
          Contains("<td class=\"line\">30 min 0 s</td><td class=\"line\">100 %</td>"));
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

TEST_CASE("sensors that stand still are not alike", "[week]") {
  ThinnedHistory course = week_of_sensors(0.0, 1);
  for (ThinnedColumn& column : course.columns) column.values.assign(course.time_s.size(), 19.8);
  for (const SensorWeek& sensor : sensors_of(course)) CHECK(sensor.neighbour.empty());
}

TEST_CASE("advice names a drifting sensor, not a steady one", "[week]") {
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

TEST_CASE("a suspected sensor has its own line of advice", "[week]") {
  MachineWeek week;
  week.span = {begin_s, begin_s + 7 * day_s};
  week.course = week_of_sensors(2.0, 3);  // `column` drifts as well
  week.sensors = sensors_of(week.course);
  RecordedEvent suspected = fault_at(1000, {SubjectKind::suspected_sensor, "column"}, "suspected");
  suspected.value = 2.0;
  const WeekEvents events{
      {mode_at(0, "compensating"),
       fault_at(1000, {SubjectKind::reason, "sensor_suspected"}, "sensor_suspected"), suspected,
       recovery_at(8200, {SubjectKind::suspected_sensor, "column"}, ""),
       recovery_at(8200, {SubjectKind::reason, "sensor_suspected"}, "")},
      {{1, begin_s + 7 * day_s}}};
  week.modes = mode_spells(events, week.span);
  week.outages = outages_of(events, week.span);
  const std::vector<std::string> lines = advice(week);
  REQUIRE_FALSE(lines.empty());
  CHECK_THAT(lines[0], Contains("Sensor column is suspected: off by +2.0 K") &&
                           Contains("1 time, 2 h 0 min in all. Do:") && Contains("thermometer"));
  for (const std::string& line : lines) {
    CHECK_THAT(line, !Contains("drifted by"));  // not reported twice
    CHECK_THAT(line, !Contains("a sensor disagrees with its neighbours"));
  }
  const std::string html = week_html(week);
  CHECK_THAT(html, Contains(">2 h 0 min</td>"));
  CHECK_THAT(html, Contains("No faults of buses, devices or controller."));
}

TEST_CASE("faults caused by a bus share a line, a broken sensor has its own", "[week]") {
  WeekEvents events{{}, {{1, begin_s + day_s}}};
  events.events.push_back(fault_at(1000, cabinet, "no answer"));
  for (const char* name : {"bed", "column", "oil"})
    events.events.push_back(fault_at(1001, {SubjectKind::sensor, name}, "no_answer"));
  for (const char* name : {"bed", "column", "oil"})
    events.events.push_back(recovery_at(1700, {SubjectKind::sensor, name}, "no_answer"));
  events.events.push_back(recovery_at(1700, cabinet, "no answer"));
  events.events.push_back(fault_at(5000, {SubjectKind::sensor, "oil"}, "open_circuit"));
  events.events.push_back(recovery_at(9000, {SubjectKind::sensor, "oil"}, "open_circuit"));
  MachineWeek week;
  week.span = {begin_s, begin_s + day_s};
  week.outages = outages_of(events, week.span);
  REQUIRE(week.outages.size() == 4);
  CHECK(week.outages[0].subject.name == "oil");
  CHECK(week.outages[0].count == 2);
  CHECK(week.outages[0].kinds.at("open_circuit").count == 1);
  CHECK(week.outages[0].kinds.at("open_circuit").lasted_s == Approx(4000.0).margin(1e-3));
  const std::vector<std::string> lines = advice(week);
  REQUIRE(lines.size() == 3);
  CHECK_THAT(lines[0], Contains("Bus cabinet: no answer, 1 time, 11 min 40 s in all."));
  CHECK_THAT(lines[1], Contains("Sensor oil: sensor wire broken, 1 time, 1 h 6 min"));
  CHECK_THAT(lines[2], Contains("Sensors oil, bed, column: the unit does not answer, 1 time") ||
                           Contains("Sensors bed, column, oil: the unit does not answer, 1 time"));
}

TEST_CASE("a picture does not bridge the hours in which the daemon did not run", "[week]") {
  MachineWeek week;
  week.span = {begin_s, begin_s + 7 * day_s};
  week.course = week_of_sensors(0.0, 3);
  const auto pens = [&] {
    const std::string html = week_html(week);
    const std::size_t at = html.find("fill=\"none\" stroke=\"#2b6cb0\"");
    const std::string path = html.substr(at, html.find("/>", at) - at);
    return std::count(path.begin(), path.end(), 'M');
  };
  CHECK(pens() == 1);
  for (std::size_t i = 300; i < 360; ++i) week.course.columns[0].values[i] = std::nan("");
  CHECK(pens() == 2);
  week.course.columns[0].values[500] = std::nan("");  // a single missing point is not a gap
  CHECK(pens() == 2);
}

TEST_CASE("a point of a course is sent, of a dry run, or of both", "[week]") {
  ThinnedHistory course;
  course.time_s = {5.0, 15.0, 25.0, 35.0};
  const auto places = places_of(course, {{26.0, 40.0}}, {{0.0, 22.0}});
  REQUIRE(places.size() == 4);
  CHECK(places[0] == PointPlace::dry_run);
  CHECK(places[1] == PointPlace::dry_run);
  CHECK(places[2] == PointPlace::both);
  CHECK(places[3] == PointPlace::sent);
}

TEST_CASE("offsets of a dry run are not reported as compensated", "[week]") {
  const TempFolder folder;
  const auto config = history_config(folder / "h.db");
  // The configuration text is the gain of the model: 2 in a dry run, 0.5 otherwise.
  const SetupParser parser = [](const SegmentSetup& text) {
    ReplaySetup setup = parse_test_setup(text);
    setup.dry_run = std::stod(text.config_text) > 1.0;
    return setup;
  };
  RecordedMachine machine(config, 11, 65536, still_clocks);
  machine.start();
  machine.run(12000);
  machine.writer().note(measured_z(zero_s + 60.0, 2.5));
  machine.reload(0.5);
  machine.run(12000);
  machine.stop();

  double dry_um = 0.0;
  double sent_um = 0.0;
  double at_probing_um = 0.0;
  std::size_t near = 0;
  const auto note = [&](const ReplayedOffsets& offsets) {
    double& largest = offsets.time_s < 120.0 ? dry_um : sent_um;
    largest = std::max(largest, std::abs(offsets.recorded_um[1]));
    if (std::abs(offsets.time_s - 60.0) > 2.0) return;
    at_probing_um += offsets.recorded_um[1];
    ++near;
  };
  static_cast<void>(replay(config.file, note, {}, parse_test_setup));
  const MachineWeek week = machine_week(config.file, recorded_span(config.file), parser);
  CHECK(week.dry_run_s() == Approx(120.0).margin(1.0));
  CHECK_FALSE(week.dry_run);
  REQUIRE(week.axes.size() == 2);
  const AxisWeek& z = week.axes[1];
  REQUIRE(z.dry_run.is_there());
  REQUIRE(z.sent.is_there());
  CHECK(std::max(std::abs(z.dry_run.low_um), std::abs(z.dry_run.high_um)) ==
        Approx(dry_um).margin(0.1 * dry_um + 0.5));
  CHECK(std::max(std::abs(z.sent.low_um), std::abs(z.sent.high_um)) ==
        Approx(sent_um).margin(0.1 * sent_um + 0.5));
  REQUIRE(week.probings.size() == 1);
  CHECK(week.probings[0].dry_run);
  const double computed_um = at_probing_um / static_cast<double>(near);
  CHECK(week.probings[0].offset_um == Approx(computed_um).margin(0.3));
  // In a dry run a probing measures the total displacement.
  CHECK(week.probings[0].left_um == Approx(2.5 + computed_um).margin(0.3));
  const std::string html = week_html(week);
  CHECK_THAT(html, Contains("offset sent") && Contains("computed in the dry run, not sent") &&
                       Contains("(dry run)") && Contains("were a dry run"));

  const MachineWeek dry = machine_week(config.file, {zero_s, zero_s + 110.0}, parser);
  CHECK(dry.dry_run);
  CHECK_FALSE(dry.axes.at(1).sent.is_there());
  const std::string dry_html = week_html(dry);
  CHECK_THAT(dry_html, Contains("Nothing was sent.") && !Contains(">offset sent<"));
}

TEST_CASE("time with a model of zeros is not compensated", "[week]") {
  const TempFolder folder;
  const auto config = history_config(folder / "h.db");
  const SetupParser parser = [](const SegmentSetup& text) {
    ReplaySetup setup = parse_test_setup(text);
    if (std::stod(text.config_text) > 1.0) return setup;
    setup.model.guideways.clear();
    setup.model.terms.clear();
    for (std::vector<double>& row : setup.model.matrix_um_per_K)
      std::fill(row.begin(), row.end(), 0.0);
    return setup;
  };
  RecordedMachine machine(config, 11, 65536, still_clocks);
  machine.start();
  machine.run(12000);
  machine.reload(0.5);
  machine.run(6000);
  machine.reload(2.0);
  machine.run(6000);
  machine.writer().note(mode_at(zero_s - begin_s, "compensating"));
  machine.stop();
  const MachineWeek week = machine_week(config.file, recorded_span(config.file), parser);
  CHECK(week.mode_s("compensating") == Approx(180.0).margin(1.0));
  CHECK(week.mode_s(zero_model) == Approx(60.0).margin(1.0));
  CHECK_THAT(week_html(week), Contains("every coefficient of the model is 0") &&
                                  Contains("make a model") &&
                                  !Contains("nothing needs to be done"));
}

TEST_CASE("offsets and probings of a recorded machine equal those of replay", "[week]") {
  const TempFolder folder;
  const auto config = history_config(folder / "h.db");
  RecordedMachine machine(config, 11, 65536, still_clocks);
  machine.start();
  machine.run(12000);  // two minutes
  Event compensating = mode_at(zero_s - begin_s, "compensating");
  compensating.number = 1;
  Event probed = measured_z(zero_s + 60.0, 2.5);
  probed.number = 2;
  Event disabled = mode_at(zero_s - begin_s + 90.0, "disabled");
  disabled.number = 3;
  for (const Event& event : {compensating, probed, disabled}) machine.writer().note(event);
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
  CHECK(week.axes[1].sent.low_um == Approx(*low).margin(0.1 * (*high - *low) + 0.5));
  CHECK(week.axes[1].sent.high_um == Approx(*high).margin(0.1 * (*high - *low) + 0.5));
  REQUIRE(week.probings.size() == 1);
  CHECK(week.probings[0].left_um == 2.5);
  CHECK(week.probings[0].offset_um ==
        Approx(at_probing_um / static_cast<double>(near)).margin(0.3));
  const std::string html = week_html(week);
  CHECK_THAT(html, Contains("What to do") && Contains("2.50 µm"));
  CHECK(html.find("http") == std::string::npos);
}
