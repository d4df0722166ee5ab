/// Checks of a history, and ways to damage its file.
#pragma once

#include <thread>

#include <catch2/catch.hpp>
#include <sqlite3.h>

#include "daemon/history/reading/history_reader.hpp"
#include "daemon/history/replay/replay.hpp"
#include "history_fixture.hpp"

namespace thermocomp::testing {

/// With a clock of its own, without the writer's thread; not started.
class ClockedMachine : public RecordedMachine {
 public:
  ClockedMachine(const HistoryConfig& config, unsigned seed)
      : RecordedMachine(config, seed, 65536,
                        {[this] { return now; }, [this] { return now + wall_minus_now; }}) {}

  /// Records cycles, and lets the writer work after that time.
  void work(std::uint64_t cycles, nanoseconds after = std::chrono::seconds(1)) {
    run(cycles);
    now += after;
    writer().work();
  }

  nanoseconds now{std::chrono::hours(7)};
  nanoseconds wall_minus_now{0};
};

template <class Condition>
bool eventually(Condition condition) {
  for (int i = 0; i < 400; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return false;
}

inline ReplaySummary replay_quietly(const std::filesystem::path& file) {
  return replay(file, {}, {}, parse_test_setup);
}

inline std::uint64_t records_in(const std::filesystem::path& file) {
  const HistoryReader reader(file);
  std::uint64_t records = 0;
  for (const SegmentInfo& segment : reader.segments()) records += segment.records;
  return records;
}

inline std::string damage_text(const std::vector<HistoryDamage>& damage) {
  std::string text;
  for (const HistoryDamage& part : damage) text += to_string(part) + "\n";
  return text;
}

inline std::string damage_text(const std::vector<std::string>& news) {
  std::string text;
  for (const std::string& line : news) text += line + "\n";
  return text;
}

inline void run_sql(const std::filesystem::path& file, const char* sql) {
  sqlite3* handle = nullptr;
  REQUIRE(sqlite3_open(file.c_str(), &handle) == SQLITE_OK);
  REQUIRE(sqlite3_exec(handle, sql, nullptr, nullptr, nullptr) == SQLITE_OK);
  sqlite3_close(handle);
}

inline bool has_moved_aside(const std::filesystem::path& folder) {
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().string().find(".damaged-") != std::string::npos) return true;
  }
  return false;
}

}  // namespace thermocomp::testing
