// StateKeeper: times of writing, and reports of failures.
#include <atomic>
#include <thread>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <sys/syscall.h>

#include "daemon/state/state_file.hpp"
#include "history_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;
using namespace std::chrono_literals;

namespace {

std::atomic<bool> disk_is_stalled{false};

}  // namespace

/// Replaces the C library's.
extern "C" int fsync(int file) {
  while (disk_is_stalled) std::this_thread::sleep_for(1ms);
  return static_cast<int>(syscall(SYS_fsync, file));
}

namespace {

struct Kept {
  TempFolder folder;
  std::filesystem::path file = folder / "state.json";
  StateKeeper::Clock::time_point now{1h};

  [[nodiscard]] LoadedState on_disk() const { return load_state_file(file, {}); }
};

PersistentState with_offset(double offset_um) {
  PersistentState state;
  state.reference_degC = {{"bed_degC", 20.0}};
  state.offset_um = {{"z", offset_um}};
  return state;
}

}  // namespace

TEST_CASE("offsets alone are written every ten seconds, a switch at once", "[state]") {
  Kept kept;
  StateKeeper keeper(kept.file, with_offset(1.0), true, false);
  keeper.note(with_offset(1.0), kept.now);
  REQUIRE(keeper.wait(20s));
  CHECK_FALSE(kept.on_disk().found);
  keeper.note(with_offset(2.0), kept.now);
  REQUIRE(keeper.wait(20s));
  CHECK(kept.on_disk().state.offset_um.at("z") == 2.0);
  keeper.note(with_offset(3.0), kept.now + 9s);
  REQUIRE(keeper.wait(20s));
  CHECK(kept.on_disk().state.offset_um.at("z") == 2.0);
  PersistentState off = with_offset(3.0);
  off.enabled = false;
  keeper.note(off, kept.now + 9s);
  REQUIRE(keeper.wait(20s));
  CHECK_FALSE(kept.on_disk().state.enabled);
  off.offset_um["z"] = 4.0;
  keeper.save(off, kept.now + 9s);
  REQUIRE(keeper.wait(20s));
  CHECK(kept.on_disk().state.offset_um.at("z") == 4.0);
}

TEST_CASE("a state not from the file is written even if nothing changes", "[state]") {
  Kept kept;
  StateKeeper keeper(kept.file, with_offset(1.0), false, false);
  keeper.save(with_offset(1.0), kept.now);
  REQUIRE(keeper.wait(20s));
  CHECK(kept.on_disk().found);
}

TEST_CASE("a failed write is retried until it succeeds", "[state]") {
  Kept kept;
  const std::filesystem::path in_the_way = kept.file.string() + ".new";
  std::filesystem::create_directory(in_the_way);
  StateKeeper keeper(kept.file, with_offset(1.0), true, false);
  PersistentState off = with_offset(1.0);
  off.enabled = false;
  keeper.save(off, kept.now);
  REQUIRE(keeper.wait(20s));
  CHECK_FALSE(keeper.error().empty());
  keeper.note(off, kept.now + 1s);
  REQUIRE(keeper.wait(20s));
  CHECK_FALSE(keeper.error().empty());
  std::filesystem::remove(in_the_way);
  keeper.note(off, kept.now + 2s);
  REQUIRE(keeper.wait(20s));
  CHECK(keeper.error().empty());
  CHECK_FALSE(kept.on_disk().state.enabled);
}

TEST_CASE("a hanging disk blocks nobody and then gets the newest state only", "[state]") {
  Kept kept;
  disk_is_stalled = true;
  StateKeeper keeper(kept.file, with_offset(1.0), true, false);
  const auto begun = StateKeeper::Clock::now();
  for (int i = 2; i <= 50; ++i) keeper.save(with_offset(i), kept.now);
  CHECK_FALSE(keeper.wait(50ms));
  CHECK(StateKeeper::Clock::now() - begun < 5s);
  CHECK(keeper.saving(keeper.serial()) == StateKeeper::Saving::under_way);
  CHECK(keeper.on_disk().serial == 0);
  CHECK(keeper.on_disk().state.offset_um.at("z") == 1.0);
  CHECK(keeper.error().empty());
  keeper.poll(kept.now + 6s);
  CHECK_THAT(keeper.error(), Catch::Contains("does not answer"));
  disk_is_stalled = false;
  REQUIRE(keeper.wait(20s));
  CHECK(keeper.error().empty());
  CHECK(keeper.saving(1) == StateKeeper::Saving::on_disk);
  CHECK(keeper.on_disk().serial == keeper.serial());
  CHECK(kept.on_disk().state.offset_um.at("z") == 50.0);
}

TEST_CASE("the state on disk is reported with its serial", "[state]") {
  Kept kept;
  StateKeeper keeper(kept.file, with_offset(1.0), true, false);
  CHECK(keeper.saving(keeper.serial()) == StateKeeper::Saving::on_disk);
  keeper.save(with_offset(2.0), kept.now);
  const std::uint64_t serial = keeper.serial();
  REQUIRE(keeper.wait(20s));
  CHECK(keeper.saving(serial) == StateKeeper::Saving::on_disk);
  CHECK(keeper.on_disk().state.offset_um.at("z") == 2.0);
  std::filesystem::create_directory(kept.file.string() + ".new");
  keeper.save(with_offset(3.0), kept.now);
  REQUIRE(keeper.wait(20s));
  CHECK(keeper.saving(keeper.serial()) == StateKeeper::Saving::failed);
  CHECK(keeper.on_disk().serial == serial);
  CHECK(keeper.on_disk().state.offset_um.at("z") == 2.0);
}

TEST_CASE("a keeper ends while its disk hangs", "[state]") {
  Kept kept;
  disk_is_stalled = true;
  const auto begun = StateKeeper::Clock::now();
  {
    StateKeeper keeper(kept.file, with_offset(1.0), false, false);
    keeper.save(with_offset(1.0), kept.now);
  }
  CHECK(StateKeeper::Clock::now() - begun < 20s);
  disk_is_stalled = false;
}

TEST_CASE("a lost reference stays lost across restarts until one is taken", "[state]") {
  Kept kept;
  {
    StateKeeper keeper(kept.file, with_offset(1.0), false, true);
    keeper.save(with_offset(1.0), kept.now);
    REQUIRE(keeper.wait(20s));
  }
  CHECK(kept.on_disk().reference_lost);
  StateKeeper keeper(kept.file, kept.on_disk().state, true, kept.on_disk().reference_lost);
  CHECK(keeper.is_reference_lost());
  keeper.reference_taken();
  keeper.save(with_offset(1.0), kept.now);
  REQUIRE(keeper.wait(20s));
  CHECK_FALSE(keeper.is_reference_lost());
  CHECK_FALSE(kept.on_disk().reference_lost);
}
