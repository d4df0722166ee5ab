// The start state with a missing or damaged state file.
#include "daemon/start_state.hpp"

#include <cmath>
#include <fstream>

#include <catch2/catch.hpp>
#include <sqlite3.h>

#include "daemon/state/state_file.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "history_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

namespace {

DaemonConfig in_folder(const TempFolder& folder) {
  DaemonConfig config;
  config.state_file = folder / "state.json";
  config.history.file = folder / "h.db";
  return config;
}

/// The machine's state at the end of the history.
PersistentState record(const std::filesystem::path& file, unsigned seed, bool reloads) {
  RecordedMachine machine(history_config(file), seed);
  machine.start();
  machine.run(5000);
  if (reloads) {
    machine.reload(3.0);
    machine.run(2000);
  }
  machine.stop();
  Report report = machine.estimator().make_report();
  machine.estimator().report(report);
  return machine.estimator().persistent_state(report);
}

void damage_newest_segment(const std::filesystem::path& file) {
  sqlite3* handle = nullptr;
  REQUIRE(sqlite3_open(file.c_str(), &handle) == SQLITE_OK);
  REQUIRE(sqlite3_exec(handle,
                       "UPDATE segment SET estimator_state = zeroblob(9) WHERE id ="
                       " (SELECT max(id) FROM segment)",
                       nullptr, nullptr, nullptr) == SQLITE_OK);
  sqlite3_close(handle);
}

}  // namespace

TEST_CASE("the history ends with the machine's state", "[history]") {
  const unsigned seed = GENERATE(range(0u, 8u));
  const TempFolder folder;
  const PersistentState state = record(folder / "h.db", seed, seed % 2 == 1);
  const RecordedState recorded = last_recorded_state(folder / "h.db", parse_test_setup);
  CHECK(recorded.has_run);
  CHECK(recorded.is_newest);
  REQUIRE(recorded.state);
  CHECK_FALSE(must_be_saved(*recorded.state, state));
  CHECK(recorded.state->offset_um == state.offset_um);
}

TEST_CASE("if the newest segment is damaged, an older one is reported as such", "[history]") {
  const TempFolder folder;
  static_cast<void>(record(folder / "h.db", 1, true));
  damage_newest_segment(folder / "h.db");
  const RecordedState recorded = last_recorded_state(folder / "h.db", parse_test_setup);
  CHECK(recorded.state);
  CHECK_FALSE(recorded.is_newest);
  CHECK(recorded.problem.find("segment") == 0);
}

TEST_CASE("a damaged history is not a first start, a missing one is", "[history]") {
  const TempFolder folder;
  CHECK_FALSE(last_recorded_state(folder / "h.db", parse_test_setup).has_run);
  { const std::ofstream empty(folder / "h.db"); }
  CHECK_FALSE(last_recorded_state(folder / "h.db", parse_test_setup).has_run);
  std::ofstream(folder / "h.db") << "garbage, but once a history";
  const RecordedState recorded = last_recorded_state(folder / "h.db", parse_test_setup);
  CHECK(recorded.has_run);
  CHECK_FALSE(recorded.state);
}

TEST_CASE("no state file and no history is the first start", "[state]") {
  const TempFolder folder;
  DaemonConfig config = in_folder(folder);
  config.estimator.compensation.enabled_at_first_start = GENERATE(true, false);
  const StartState start = find_start_state(config);
  CHECK(start.state.enabled == config.estimator.compensation.enabled_at_first_start);
  CHECK(start.warnings.empty());
  CHECK_FALSE(start.reference_lost);
}

TEST_CASE("a first start is disabled unless configured otherwise", "[state]") {
  const TempFolder folder;
  const DaemonConfig config = in_folder(folder);
  CHECK_FALSE(find_start_state(config).state.enabled);
  // An operator's command overrides the configuration.
  PersistentState message;
  message.enabled = true;
  REQUIRE(
      save_state_file(config.state_file, message, false, {12.0, ReferenceOrigin::command}).empty());
  const StartState start = find_start_state(config);
  CHECK(start.state.enabled);
  CHECK(start.reference.wall_s == 12.0);
}

TEST_CASE("an unusable state file without a history keeps the compensation off", "[state]") {
  const TempFolder folder;
  const DaemonConfig config = in_folder(folder);
  std::ofstream(config.state_file) << "{";
  StartState start = find_start_state(config);
  CHECK_FALSE(start.state.enabled);
  CHECK(start.reference_lost);
  CHECK_FALSE(start.is_on_disk);
  REQUIRE(start.warnings.size() == 1);
  CHECK(start.warnings[0].find("cannot be used") != std::string::npos);
  // So does the file written afterwards.
  REQUIRE(save_state_file(config.state_file, start.state, start.reference_lost).empty());
  start = find_start_state(config);
  CHECK(start.reference_lost);
  CHECK_FALSE(start.state.enabled);
}

TEST_CASE("offsets of a file are checked against this configuration", "[state]") {
  const TempFolder folder;
  DaemonConfig config = in_folder(folder);
  BridgeControllerConfig bridge;
  bridge.name = "cnc";
  config.controller = bridge;
  config.estimator.axes = {{"z", "z_um", -1.0, {50.0, 1.0}, {}}};
  PersistentState kept;
  kept.offset_um = {{"z", 12.0}};
  kept.corridor_um = {{"z", 1.0}};
  kept.sign = {{"z", -1.0}};
  kept.controller = "bridge cnc";
  SECTION("the same axis, controller and sign") {
    REQUIRE(save_state_file(config.state_file, kept).empty());
    const StartState start = find_start_state(config, {{"z", 12.5}});
    CHECK(start.warnings.empty());
    CHECK(start.state.corridor_um.size() == 1);
    CHECK(start.state.offset_um.at("z") == 12.0);
    CHECK(start.state.recorded_um.at("z") == 12.5);
  }
  SECTION("the controller had lost it, and the file did not say so yet") {
    REQUIRE(save_state_file(config.state_file, kept).empty());
    const StartState start = find_start_state(config, {{"z", std::nan("")}});
    CHECK(start.warnings.empty());
    CHECK(start.state.corridor_um.empty());
    CHECK(start.state.recorded_um.empty());
  }
  SECTION("beyond the bound") {
    kept.offset_um["z"] = GENERATE(300.0, -499.0, 50.001);
    REQUIRE(save_state_file(config.state_file, kept).empty());
    const StartState start = find_start_state(config, {{"z", -51.0}});
    REQUIRE(start.warnings.size() == 2);
    CHECK(start.warnings[0].find("offset_um_max = 50") != std::string::npos);
    CHECK(start.warnings[1].find("last-sent record") == 0);
    CHECK(start.state.offset_um.empty());
    CHECK(start.state.recorded_um.empty());
  }
  SECTION("another sign, another controller, or a file of an earlier version") {
    const int other = GENERATE(0, 1, 2);
    if (other == 0) kept.sign["z"] = 1.0;
    if (other == 1) kept.controller = "bridge lathe";
    if (other == 2) kept.sign.clear();
    REQUIRE(save_state_file(config.state_file, kept).empty());
    const StartState start = find_start_state(config);
    REQUIRE(start.warnings.size() == 1);
    CHECK(start.state.corridor_um.empty());
  }
}
