#include <fstream>
#include <signal.h>
#include <sstream>
#include <thread>

#include <catch2/catch.hpp>
#include <sqlite3.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "config/runs/run_file.hpp"
#include "history_checks.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

TEST_CASE("replay reproduces the daemon's offsets bit for bit", "[history][replay]") {
  const unsigned seed = GENERATE(range(0u, 30u));
  const TempFolder folder;
  HistoryConfig config = history_config(folder / "h.db");
  config.segment_h = seed % 2 == 0 ? 10.0 / 3600.0 : 6.0;
  RecordedMachine machine(config, seed);
  machine.start();
  machine.run(1500);
  std::this_thread::sleep_for(std::chrono::milliseconds(seed % 5 == 0 ? 200 : 1));
  machine.run(1500);
  machine.reload(2.0 + seed);
  machine.run(2000);
  machine.stop();
  const ReplaySummary summary = replay_quietly(config.file);
  CHECK(summary.compared > 900);
  CHECK(summary.different == 0);
  CHECK(summary.largest_difference_um == 0.0);
  CHECK(summary.gaps == 0);
  CHECK(summary.segments >= 2);
}

TEST_CASE("a stop in the first cycle of a segment leaves a readable segment", "[history][replay]") {
  const TempFolder folder;
  HistoryConfig config = history_config(folder / "h.db");
  config.segment_h = 3.0 / 3600.0;
  ClockedMachine machine(config, 4);
  machine.open();
  machine.work(401, std::chrono::seconds(4));
  machine.run(1);
  machine.stop();
  machine.work(0);
  const ReplaySummary summary = replay_quietly(config.file);
  CHECK(summary.segments == 2);
  CHECK(damage_text(summary.damage).empty());
  CHECK(summary.different == 0);
  CHECK(summary.compared > 0);
}

TEST_CASE("replay detects a modified history", "[history][replay]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 3000);
  run_sql(config.file,
          "UPDATE setup SET config_text = '2.000001'; UPDATE segment SET checksum = NULL");
  const ReplaySummary summary = replay_quietly(config.file);
  CHECK(summary.different > 0);
  CHECK(summary.largest_difference_um > 0.0);
  CHECK(summary.first_different_cycle.has_value());
}

TEST_CASE("rows that no daemon wrote are reported as damage and never make a replay endless",
          "[history][damage]") {
  const std::string damage = GENERATE(
      as<std::string>(), "UPDATE segment SET period_ns = 1",
      "UPDATE segment SET last_cycle = 9223372036854775807", "UPDATE segment SET first_cycle = -5",
      "UPDATE segment SET grid_start_ns = -1", "UPDATE segment SET wall_ns = -9223372036854775807",
      "UPDATE segment SET reason = 77",
      "UPDATE segment SET estimator_state = substr(estimator_state, 1, 40)",
      "UPDATE segment SET estimator_state = zeroblob(length(estimator_state))",
      "UPDATE segment SET inputs = x'00'", "UPDATE chunk SET records = x'0000000000', count = 1",
      "UPDATE chunk SET wall_minus_grid_ns = -9223372036854775807",
      // a reading taken at -1 ns; a record of an earlier cycle than the one before
      "UPDATE chunk SET records = x'00000000' || x'0100', count = 1",
      "UPDATE chunk SET records = x'020004000000' || x'020001000000', count = 2",
      // an input after the offset of the same cycle
      "UPDATE chunk SET records = x'060100000200' || x'020000000000', count = 2");
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 500);
  run_sql(config.file, damage.c_str());
  // Without checksums the values themselves are checked.
  const bool has_checksums = GENERATE(false, true);
  if (!has_checksums) {
    run_sql(config.file, "UPDATE segment SET checksum = NULL; UPDATE chunk SET checksum = NULL");
  }
  INFO(damage << ", with checksums: " << has_checksums);
  const bool only_reported = damage.find("wall") != std::string::npos;
  const ReplaySummary replayed = replay_quietly(config.file);
  CHECK((only_reported || !replayed.damage.empty()));
  const auto [text, summary] = exported(config.file);
  CHECK(!summary.damage.empty());
  CHECK_THAT(text, Catch::Contains("# damaged: segment 1: "));
  CHECK(!check_history(config.file, {}, parse_test_setup).is_sound());
}

TEST_CASE("one flipped bit costs one chunk; all others are exported and replayed",
          "[history][damage]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  RecordedMachine machine(config, 3);
  machine.start();
  for (int part = 0; part < 8; ++part) {
    machine.run(200);
    std::this_thread::sleep_for(std::chrono::milliseconds(300));  // one commit, hence one chunk
  }
  machine.reload(3.0);
  machine.run(500);
  machine.stop();
  REQUIRE(check_history(config.file, {}, parse_test_setup).is_sound());
  const Exported before = exported(config.file);
  REQUIRE(before.summary.damage.empty());
  run_sql(config.file,
          "UPDATE chunk SET records = substr(records, 1, 40) || x'55' || substr(records, 42)"
          " WHERE segment = 1 AND number = 2");
  const HistoryCheck check = check_history(config.file, {}, parse_test_setup);
  REQUIRE(check.segments.size() == 2);
  CHECK_THAT(damage_text(check.segments[0].damage),
             Catch::Contains("chunk 2 does not fit its checksum"));
  CHECK(check.segments[1].damage.empty());
  const Exported after = exported(config.file);
  CHECK_THAT(after.text, Catch::Contains("# damaged: segment 1: chunk 2"));
  CHECK(after.summary.rows < before.summary.rows);
  CHECK(after.summary.rows > before.summary.rows / 2);
  const std::string last_row = before.text.substr(before.text.rfind('\n', before.text.size() - 2));
  CHECK_THAT(after.text, Catch::EndsWith(last_row));
  const ReplaySummary replayed = replay_quietly(config.file);
  CHECK(replayed.segments == 1);
  CHECK(replayed.compared > 0);
  CHECK(replayed.different == 0);
}

TEST_CASE("a clock set beyond the year 2116 costs only the wall time", "[history][damage]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 500, 500);
  const ExportSummary before = exported(config.file).summary;
  run_sql(config.file,
          "UPDATE segment SET wall_ns = 9000000000000000000, checksum = NULL WHERE id = 2");
  const ExportSummary after = exported(config.file).summary;
  CHECK(after.rows == before.rows);
  CHECK_THAT(damage_text(after.damage), Catch::Contains("segment 2: its wall time is impossible"));
  CHECK(replay_quietly(config.file).segments == 2);
}

TEST_CASE("a segment that claims more cycles than its chunks hold is replayed to their end",
          "[history][damage]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 500);
  run_sql(config.file, "UPDATE segment SET last_cycle = last_cycle + 1");
  const ReplaySummary summary = replay_quietly(config.file);
  CHECK_THAT(damage_text(summary.damage), Catch::Contains("end before its last cycle"));
  CHECK(summary.compared > 0);
  CHECK(summary.different == 0);
}

TEST_CASE("a start state later than the segment's first cycle is refused", "[history][damage]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 500, 500);
  run_sql(config.file,
          "UPDATE segment SET grid_start_ns = grid_start_ns - 3600000000000,"
          " checksum = NULL");
  CHECK_THAT(damage_text(replay_quietly(config.file).damage), Catch::Contains("of a later time"));
}

TEST_CASE("segments that overlap in time are damage", "[history][damage]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 500, 500);
  run_sql(config.file, "UPDATE segment SET first_cycle = 0 WHERE id = 2");
  const ReplaySummary summary = replay_quietly(config.file);
  CHECK_THAT(damage_text(summary.damage),
             Catch::Contains("segment 2: begins before the one in front"));
  CHECK(summary.segments == 1);
  CHECK(summary.different == 0);
}

TEST_CASE("a ring overflow leaves a gap, and the replay still agrees", "[history]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  RecordedMachine machine(config, 4, 256);
  machine.start();
  for (int i = 0; i < 4; ++i) {
    machine.run(5000);  // far faster than the writer drains
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
  }
  machine.run(10);
  machine.stop();
  CHECK(machine.writer().statistics().lost > 0);
  const ReplaySummary summary = replay_quietly(config.file);
  CHECK(summary.gaps > 0);
  CHECK(summary.compared > 0);
  CHECK(summary.different == 0);
}

TEST_CASE("the file keeps its size bound by deleting the oldest segments", "[history]") {
  const TempFolder folder;
  HistoryConfig config = history_config(folder / "h.db");
  config.size_MB_max = 0.5;
  RecordedMachine machine(config, 5);
  machine.start();
  std::uint64_t largest = 0;
  for (int i = 0; i < 30; ++i) {
    machine.run(10000);
    const std::uint64_t commits = machine.writer().statistics().commits;
    REQUIRE(eventually([&] { return machine.writer().statistics().commits > commits; }));
    largest = std::max(largest, machine.writer().statistics().bytes);
  }
  machine.stop();
  CHECK(largest > 200000);
  CHECK(largest <= 600000);  // the bound plus one commit at this rate
  CHECK(std::filesystem::file_size(config.file) <= 600000);
  const HistoryReader reader(config.file);
  CHECK(reader.segments().front().id > 1);
  CHECK(replay_quietly(config.file).different == 0);
}

TEST_CASE("a wrong wall clock deletes no history; recorded time does", "[history]") {
  using std::chrono::hours;
  using std::chrono::minutes;
  const TempFolder folder;
  HistoryConfig config = history_config(folder / "h.db");
  config.segment_h = 10.0 / 3600.0;
  config.age_days_max = 150.0 / 86400.0;
  constexpr nanoseconds wall_minus_now = std::chrono::seconds(1'780'000'000);
  ClockedMachine machine(config, 9);
  const auto segments_after = [&](nanoseconds time) {
    machine.work(1100, time);  // records 11 s
    return machine.writer().statistics().segments;
  };
  machine.open();
  std::uint64_t segments = 0;
  for (const nanoseconds wrong :
       {nanoseconds{0}, nanoseconds(hours(24 * 3650)), nanoseconds(-wall_minus_now)}) {
    machine.wall_minus_now = wall_minus_now + wrong;
    for (int i = 0; i < 4; ++i) {
      const std::uint64_t before = segments;
      segments = segments_after(minutes(61));
      CHECK(segments >= before);
    }
  }
  CHECK(machine.writer().statistics().deleted == 0);
  CHECK(machine.writer().take_messages().empty());
  machine.wall_minus_now = wall_minus_now;
  for (int i = 0; i < 12; ++i) segments = segments_after(minutes(1));
  const HistoryStatistics statistics = machine.writer().statistics();
  CHECK(statistics.deleted >= 8);
  CHECK(segments <= 16);
  const std::vector<std::string> news = machine.writer().take_messages();
  REQUIRE_FALSE(news.empty());
  CHECK_THAT(news.front(),
             Catch::Contains("deleted: more than") && Catch::Contains("recorded after them"));
  machine.stop();
  CHECK(replay_quietly(config.file).different == 0);
}

TEST_CASE("a segment of damaged length does not age the others", "[history]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  for (unsigned seed = 0; seed < 3; ++seed) recorded_history(config.file, 500, 0, seed);
  run_sql(config.file, "UPDATE segment SET last_cycle = 1000000000000000 WHERE id = 3");
  RecordedMachine machine(config, 4);
  machine.start();
  machine.run(500);
  machine.stop();
  CHECK(machine.writer().statistics().deleted == 0);
  CHECK(machine.writer().statistics().segments == 4);
}

TEST_CASE("a wall clock that is set begins a segment with the new time", "[history]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  const double set_by_s = GENERATE(7200.0, -3600.0);
  ClockedMachine machine(config, 1);
  machine.wall_minus_now = std::chrono::seconds(1'780'000'000);
  machine.open();
  machine.work(200, nanoseconds{0});
  machine.wall_minus_now += to_nanoseconds(set_by_s);
  for (int i = 0; i < 3; ++i) machine.work(200, std::chrono::seconds(10));
  machine.stop();
  machine.work(0);
  const HistoryReader reader(config.file);
  REQUIRE(reader.segments().size() == 2);
  const auto& [before, after] = std::pair(reader.segments()[0], reader.segments()[1]);
  const double passed_s = 1e-9 * static_cast<double>(after.wall_ns - before.wall_ns);
  CHECK(passed_s > set_by_s);
  CHECK(passed_s < set_by_s + 60.0);
}
