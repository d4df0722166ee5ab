// Exports of a history: run files and events.
#include <cmath>
#include <sstream>
#include <string>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"
#include "daemon/history/reading/history_reader.hpp"
#include "history_checks.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

namespace {

bool has_negative_zero(const std::string& text) {
  return text.find(",-0,") != std::string::npos || text.find(",-0\n") != std::string::npos;
}

}  // namespace

TEST_CASE("an export is a run file with the daemon's model inputs", "[history][export]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  RecordedMachine machine(config, 12);
  machine.start();
  machine.run(3000);
  machine.reload(5.0);
  machine.run(1000);
  Report last = machine.estimator().make_report();
  machine.estimator().report(last);
  machine.stop();
  const auto [part, summary] = exported(config.file, HistoryTime{5.0, {}}, HistoryTime{20.0, {}});
  const RunFile run = parse_run(part, "export");
  CHECK(run.rows() == summary.rows);
  CHECK(run.time_s().front() == 0.0);
  CHECK(run.time_s().back() < 15.0);
  CHECK(run.time_s().back() > 14.0);
  for (const char* name :
       {"bed_in_degC", "spindle_rpm", "y_offset_um", "z_applied_um", "z_measured_um"}) {
    CHECK(run.find(name).has_value());
  }
  CHECK(!run.find("bed_degC"));  // included in its block

  const Exported all = exported(config.file);
  REQUIRE(all.summary.damage.empty());
  const RunFile whole = parse_run(all.text, "export");
  CHECK_FALSE(has_negative_zero(all.text));
  const auto columns = machine.estimator().model().temperature_columns();
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const double temp_degC = whole.column(columns[i]).back();
    if (last.inputs[i].good)
      CHECK(temp_degC == last.inputs[i].temp_degC);  // bitwise
    else
      CHECK(std::isnan(temp_degC));
  }

  std::ostringstream replayed;
  replay_to_csv(config.file, replayed, {}, parse_test_setup);
  const RunFile offsets = parse_run(replayed.str(), "replay");
  CHECK(offsets.column("z_offset_um") == offsets.column("z_recorded_um"));
}

TEST_CASE("an export has timed comments on faults, commands, wall time and reloads",
          "[history][export]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 4000, 1000, 12);
  const std::string whole = exported(config.file).text;
  for (const char* comment :
       {"# 0.000 s: wall time ", "# 0.000 s: model SHA-256 sum", ": sensor bed: open_circuit\n",
        ": sensor bed: good again\n", ": command measured ",
        "reloaded or restarted with another configuration"})
    CHECK_THAT(whole, Catch::Contains(comment));
  // Without the commands before the exported part.
  const std::string part = exported(config.file, HistoryTime{49.0, {}}).text;
  const auto commands = [](const std::string& text) {
    std::size_t count = 0;
    for (std::size_t at = text.find(": command "); at != std::string::npos;
         at = text.find(": command ", at + 1))
      ++count;
    return count;
  };
  CHECK(commands(part) < commands(whole));
}

TEST_CASE("an export of sensors has every raw reading and no inputs", "[history][export]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 1000, 0, 12);
  std::ostringstream out;
  export_run(config.file, {}, {}, out, {}, parse_test_setup, ExportContent::sensors);
  const RunFile run = parse_run(out.str(), "export");
  CHECK(run.find("bed_degC"));
  CHECK(!run.find("bed_in_degC"));
}

TEST_CASE("a probing is exported as displacement, without the offset in effect",
          "[history][export]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 20000, 0, 12);
  const RunFile run = parse_run(exported(config.file).text, "export");
  std::size_t probed = 0;
  for (const char* axis : {"y", "z"}) {
    const std::string name(axis);
    if (!run.find(name + "_um")) continue;
    const auto message = run.column(name + "_measured_um");
    const auto displacement = run.column(name + "_um");
    const auto applied = run.column(name + "_applied_um");
    for (std::size_t row = 0; row < run.rows(); ++row) {
      CHECK(std::isnan(message[row]) == std::isnan(displacement[row]));
      if (std::isnan(message[row]) || !std::isfinite(applied[row])) continue;
      // The applied offset may be a tenth of a second newer.
      CHECK(std::abs(message[row] - applied[row] - displacement[row]) < 0.2);
      ++probed;
    }
  }
  CHECK(probed > 3);
}

TEST_CASE("without read-back a probing is exported without the offset sent, not the registers'",
          "[history][export]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 20000, 0, 12);
  std::ostringstream out;
  export_run(config.file, {}, {}, out, {}, [](const SegmentSetup& setup) {
    ReplaySetup unread = parse_test_setup(setup);
    unread.estimator.controller_reads_back = false;
    return unread;
  });
  const RunFile run = parse_run(out.str(), "export");
  const auto applied = run.column("z_applied_um");
  const auto offset = run.column("z_offset_um");
  const auto message = run.column("z_measured_um");
  const auto displacement = run.column("z_um");
  std::size_t probed = 0;
  for (std::size_t row = 0; row < run.rows(); ++row) {
    CHECK(std::isnan(applied[row]));
    if (std::isnan(displacement[row])) continue;
    CHECK(std::abs(message[row] - offset[row] - displacement[row]) < 0.2);
    ++probed;
  }
  CHECK(probed > 0);
}

TEST_CASE("the next commit writes events, by run, and keeps the newest", "[history][events]") {
  const TempFolder folder;
  HistoryConfig config = history_config(folder / "h.db");
  config.size_MB_max = 2.67;  // keeps about 300
  for (int run = 0; run < 2; ++run) {
    HistoryWriter writer(config, {std::chrono::hours(7), std::chrono::milliseconds(10)}, "test");
    writer.start();
    for (int i = 1; i <= 300; ++i) {
      Event event{.kind = EventKind::command,
                  .subject = {SubjectKind::axis, "z"},
                  .code = "measured",
                  .value = 0.1 * static_cast<double>(i)};
      event.number = static_cast<std::uint64_t>(i);
      event.wall_s = static_cast<double>(1000 * run + i);
      if (i == 7) event.duration_s = 28.1;
      writer.note(event);
    }
    writer.stop();
    const std::vector<RecordedEvent> read = read_events(config.file);
    REQUIRE(read.size() >= 300);
    CHECK(read.size() <= 334);
    CHECK(read.back().run == run + 1);
    CHECK(read.back().number == 300);
    if (run == 0) {
      CHECK(read[6].duration_s == 28.1);
      CHECK(read[6].subject == Subject{SubjectKind::axis, "z"});
      CHECK(read[6].value == 0.1 * 7.0);
    }
  }
  CHECK(read_events(config.file, HistoryTime{{}, 1'290'000'000'000}).size() == 11);
}

TEST_CASE("a start is told from when on no daemon had run", "[history][events]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  const auto run = [&](double began_s, std::optional<double> stopped_s) {
    HistoryWriter writer(config, {std::chrono::hours(7), std::chrono::milliseconds(10)}, "test");
    writer.start();
    writer.note({.number = 1, .wall_s = began_s, .code = "started"});
    if (stopped_s) writer.note({.number = 2, .wall_s = *stopped_s, .code = "stopping"});
    writer.stop();
  };
  run(1000.0, 1100.0);
  run(1160.0, std::nullopt);
  run(1300.0, std::nullopt);
  const std::vector<RecordedEvent> read = read_events(config.file);
  REQUIRE(read.size() == 4);
  CHECK(std::isnan(read[0].duration_s));
  CHECK(read[2].duration_s == 60.0);
  CHECK(std::isnan(read[3].duration_s));  // a run without records that was not stopped
}

TEST_CASE("texts of a damaged history do not add lines to an export", "[history][export][damage]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 500, 0, 12);
  run_sql(config.file,
          "UPDATE setup SET model_checksum = 'a' || char(10) || '1,2,3' || char(27);"
          "UPDATE segment SET checksum = NULL");
  const auto [text, summary] = exported(config.file);
  CHECK(text.find('\033') == std::string::npos);
  CHECK(parse_run(text, "export").rows() == summary.rows);
}
