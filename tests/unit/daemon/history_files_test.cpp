// Files of a history removed, damaged, foreign, or on a full disk, while it is written.
#include <fstream>
#include <signal.h>

#include <sys/resource.h>
#include <sys/wait.h>

#include "history_checks.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

TEST_CASE(
    "-wal or -shm removed, replaced or cut while running: no row is lost, and this is reported",
    "[history][files]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  const std::string wal = config.file.string() + "-wal";
  const std::string shm = config.file.string() + "-shm";
  ClockedMachine machine(config, 11);
  machine.open();
  const auto commit = [&] { machine.work(300); };
  for (int i = 0; i < 5; ++i) commit();
  std::filesystem::copy_file(wal, folder / "old-wal");
  for (int i = 0; i < 5; ++i) commit();
  SECTION("both removed") {
    std::filesystem::remove(wal);
    std::filesystem::remove(shm);
  }
  SECTION("-wal removed") {
    std::filesystem::remove(wal);
  }
  SECTION("-shm removed") {
    std::filesystem::remove(shm);
  }
  SECTION("-wal cut") {
    std::filesystem::resize_file(wal, 0);
  }
  SECTION("an older -wal put in its place") {
    std::filesystem::rename(folder / "old-wal", wal);
  }
  SECTION("a reader that comes in between") {
    std::filesystem::remove(wal);
    std::filesystem::remove(shm);
    const HistoryReader reader(config.file);
    CHECK(reader.segments().size() == 1);
  }
  const std::uint64_t written = machine.writer().statistics().records;
  // As after kill -9 at this moment: committed rows are in the database.
  std::filesystem::copy_file(config.file, folder / "killed.db");
  CHECK(records_in(folder / "killed.db") == written);
  commit();
  CHECK(machine.writer().statistics().replaced == 1);
  CHECK(machine.writer().statistics().working);
  CHECK(machine.writer().statistics().lost == 0);
  CHECK_THAT(damage_text(machine.writer().take_messages()),
             Catch::Contains("reopened") && !Catch::Contains("lost"));
  commit();
  CHECK(records_in(config.file) == machine.writer().statistics().records);
  CHECK(machine.writer().statistics().replaced == 1);
  machine.stop();
  const ReplaySummary summary = replay_quietly(config.file);
  CHECK(summary.damage.empty());
  CHECK(summary.different == 0);
  CHECK(summary.segments == 1);
}

TEST_CASE("rows whose only copy was in a removed -wal wait until they can be written",
          "[history][files]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  ClockedMachine machine(config, 12);
  machine.open();
  const auto commit = [&] { machine.work(3000); };
  commit();
  // Rows committed while a reader is active stay in the log.
  sqlite3* reader = nullptr;
  REQUIRE(sqlite3_open(config.file.c_str(), &reader) == SQLITE_OK);
  REQUIRE(sqlite3_exec(reader, "BEGIN; SELECT count(*) FROM chunk", nullptr, nullptr, nullptr) ==
          SQLITE_OK);
  commit();
  commit();
  const std::uint64_t written = machine.writer().statistics().records;
  std::filesystem::remove(config.file.string() + "-wal");
  sqlite3_close(reader);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, SIG_IGN);
  rlimit tight = before;
  tight.rlim_cur = std::filesystem::file_size(config.file);
  REQUIRE(setrlimit(RLIMIT_FSIZE, &tight) == 0);
  commit();
  const HistoryStatistics failed = machine.writer().statistics();
  setrlimit(RLIMIT_FSIZE, &before);
  CHECK(failed.errors > 0);
  CHECK(failed.lost == 0);
  CHECK(damage_text(machine.writer().take_messages()).empty());
  machine.now += std::chrono::minutes(1);
  commit();
  CHECK_THAT(damage_text(machine.writer().take_messages()), Catch::Contains("reopened"));
  CHECK(machine.writer().statistics().replaced == 1);
  CHECK(machine.writer().statistics().lost == 0);
  machine.stop();
  CHECK(records_in(config.file) > written);
  const ReplaySummary summary = replay_quietly(config.file);
  CHECK(damage_text(summary.damage).empty());
  CHECK(summary.different == 0);
  CHECK(summary.segments == 1);
}

TEST_CASE("a moved history or folder is reported and a new history begins", "[history][files]") {
  const TempFolder folder;
  std::filesystem::create_directory(folder / "place");
  const HistoryConfig config = history_config(folder / "place/h.db");
  ClockedMachine machine(config, 12);
  machine.open();
  const auto commit = [&] { machine.work(300, std::chrono::seconds(70)); };
  for (int i = 0; i < 5; ++i) commit();
  const std::uint64_t written = machine.writer().statistics().records;
  std::filesystem::path moved = folder / "moved.db";
  SECTION("the database alone") {
    std::filesystem::rename(config.file, moved);
  }
  SECTION("the folder") {
    std::filesystem::rename(folder / "place", folder / "elsewhere");
    std::filesystem::create_directory(folder / "place");
    moved = folder / "elsewhere/h.db";
  }
  for (int i = 0; i < 4; ++i) commit();
  CHECK(machine.writer().statistics().replaced == 1);
  CHECK_THAT(damage_text(machine.writer().take_messages()),
             Catch::Contains("a new history begins"));
  CHECK(records_in(moved) == written);
  machine.stop();
  CHECK(replay_quietly(config.file).different == 0);
  CHECK(replay_quietly(config.file).segments >= 1);
}

TEST_CASE("a file that is not a database is moved aside and a new one begins", "[history]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  std::ofstream(config.file) << std::string(20000, 'x');
  recorded_history(config.file, 300);
  CHECK(has_moved_aside(folder.path()));
  CHECK(replay_quietly(config.file).different == 0);
}

TEST_CASE("a file that is damaged while running is moved aside", "[history]") {
  const TempFolder folder;
  const HistoryConfig config = recorded_history(folder / "h.db", 20000, 0, 7);
  std::fstream file(config.file, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(4096);
  file << std::string(40000, '\xA5');
  file.close();
  RecordedMachine machine(config, 8);
  machine.start();
  machine.run(300);
  REQUIRE(eventually([&] { return machine.writer().statistics().working; }));
  machine.run(300);
  REQUIRE(eventually([&] {
    machine.run(20);
    return machine.writer().statistics().records > 0;
  }));
  machine.stop();
  CHECK(has_moved_aside(folder.path()));
  CHECK(replay_quietly(config.file).different == 0);
}

TEST_CASE("a newer version and another program's database are refused", "[history]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  SECTION("newer") {
    recorded_history(config.file, 0);
    run_sql(config.file, "PRAGMA user_version = 99");
    CHECK_THROWS_WITH(HistoryReader(config.file), Catch::Contains("version 99"));
    CHECK_THROWS_WITH(HistoryWriter(config, Grid{}, "test").start(), Catch::Contains("version 99"));
  }
  SECTION("of no version") {
    recorded_history(config.file, 0);
    const std::string version = GENERATE(as<std::string>(), "0", "-1");
    run_sql(config.file, ("PRAGMA user_version = " + version).c_str());
    CHECK_THROWS_WITH(HistoryReader(config.file), Catch::Contains("version " + version));
    CHECK_THROWS_WITH(HistoryWriter(config, Grid{}, "test").start(),
                      Catch::Contains("version " + version));
  }
  SECTION("a loop of links") {
    std::filesystem::create_symlink(folder / "b.db", folder / "a.db");
    std::filesystem::create_symlink(folder / "a.db", folder / "b.db");
    const HistoryConfig looped = history_config(folder / "a.db");
    CHECK_THROWS_AS(HistoryReader(looped.file), HistoryError);
    HistoryWriter writer(looped, Grid{}, "test");
    try {
      writer.start();
      writer.stop();
    } catch (const HistoryError& error) {
      CHECK_THAT(error.what(), Catch::Contains("loop of links"));
    }
  }
  SECTION("foreign") {
    run_sql(config.file, "CREATE TABLE mine (x)");
    CHECK_THROWS_WITH(HistoryWriter(config, Grid{}, "test").start(),
                      Catch::Contains("not a history of thermocomp"));
    CHECK_THROWS_AS(HistoryReader(config.file), HistoryError);
  }
  SECTION("missing") {
    CHECK_THROWS_WITH(HistoryReader(config.file), Catch::Contains("no such file"));
  }
}

TEST_CASE("a history is read while it is written", "[history]") {
  const TempFolder folder;
  const HistoryConfig config = history_config(folder / "h.db");
  RecordedMachine machine(config, 11);
  machine.start();
  machine.run(2000);
  REQUIRE(eventually([&] { return machine.writer().statistics().records > 0; }));
  CHECK(replay_quietly(config.file).different == 0);
  CHECK(replay_quietly(config.file).compared > 0);
  machine.stop();
}
