// Answers to operators, compared with the state on disk.
#include "daemon/operations.hpp"

#include <optional>
#include <thread>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "daemon/state/state_file.hpp"
#include "drivers/controllers/kinds/make_controller.hpp"
#include "history_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;
using namespace std::chrono_literals;

namespace {

class SteadySource final : public SensorSource {
 public:
  void start() override {}
  void stop() noexcept override {}
  [[nodiscard]] BusHealth health() const override { return {}; }
  void newest(std::span<Reading> all) noexcept override {
    for (Reading& reading : all) reading = {20.0, now, Fault::none};
  }
  nanoseconds now{};
};

DaemonConfig machine_config(const std::filesystem::path& folder) {
  DaemonConfig config;
  ReplaySetup setup = machine_setup(2.0);
  config.estimator = std::move(setup.estimator);
  config.model = std::move(setup.model);
  for (SensorConfig& sensor : config.estimator.sensors) sensor.smoothing.form = SmoothingForm::off;
  config.file = folder / "missing.toml";
  config.state_file = folder / "state.json";
  return config;
}

/// A daemon whose cycle is stepped by the test.
struct Rig {
  explicit Rig(bool reference_lost = false)
      : keeper(config.state_file, {}, true, reference_lost), next(cycle.begin(grid.start)) {
    step();
  }
  void step() {
    source.now = grid.time_of(next);
    cycle.step(next++);
  }
  [[nodiscard]] LoadedState on_disk() const { return load_state_file(config.state_file, {}); }
  /// Sends the command, steps, and returns the answer.
  nlohmann::json give(CommandKind kind) {
    const RpcPending pending = operations.command({kind, 0, 0.0});
    CHECK_FALSE(pending());
    step();
    return answer(pending);
  }
  /// Returns once the change is on disk.
  static nlohmann::json answer(const RpcPending& pending) {
    std::optional<nlohmann::json> found;
    while (!(found = pending())) std::this_thread::sleep_for(1ms);
    return *found;
  }

  TempFolder folder;
  DaemonConfig config = machine_config(folder.path());
  SteadySource source;
  DryRunController controller{{"none", 2}};
  Grid grid{1h, 10ms};
  StateKeeper keeper;
  ServiceManager service;
  Cycle cycle{grid, {&source}, controller, 3, make_cycle_parts(config, nullptr)};
  std::uint64_t next;
  Operations operations{{config, cycle, keeper, service, nullptr, [] { return std::string(); }}};
};

}  // namespace

TEST_CASE("done means on disk", "[daemon]") {
  Rig rig;
  CHECK(rig.give(CommandKind::disable) == nlohmann::json{{"done", true}});
  CHECK(rig.on_disk().found);
  CHECK_FALSE(rig.on_disk().state.enabled);
  CHECK(rig.give(CommandKind::enable) == nlohmann::json{{"done", true}});
  CHECK(rig.on_disk().state.enabled);
}

TEST_CASE("a command that cannot be saved is not reported as done", "[daemon]") {
  Rig rig;
  std::filesystem::create_directory(rig.config.state_file.string() + ".new");
  CHECK_THROWS_WITH(rig.give(CommandKind::disable), Catch::Contains("carried out, but not saved"));
}

TEST_CASE("while the reference is lost, enable is refused until one is taken", "[daemon]") {
  Rig rig(true);
  CHECK_THROWS_WITH(rig.operations.command({CommandKind::enable, 0, 0.0}),
                    Catch::Contains("thermocomp reference"));
  CHECK(rig.give(CommandKind::reference) == nlohmann::json{{"done", true}});
  CHECK_FALSE(rig.on_disk().reference_lost);
  CHECK(rig.give(CommandKind::enable) == nlohmann::json{{"done", true}});
}

TEST_CASE("a reload of an unreadable file changes nothing", "[daemon]") {
  Rig rig;
  CHECK_THROWS_AS(Rig::answer(rig.operations.reload()), ConfigurationError);
  rig.operations.reload_by_signal();  // the same, logged
  CHECK_FALSE(rig.operations.is_busy());
  CHECK(rig.give(CommandKind::disable) == nlohmann::json{{"done", true}});
}

TEST_CASE("a command's change is saved without a further request", "[daemon]") {
  Rig rig;
  static_cast<void>(rig.operations.command({CommandKind::disable, 0, 0.0}));
  rig.step();
  rig.operations.poll();
  REQUIRE(rig.keeper.wait(20s));
  CHECK_FALSE(rig.on_disk().state.enabled);
}

TEST_CASE("time and origin of the reference are saved with it", "[daemon]") {
  Rig rig;
  rig.operations.save_state(false);
  REQUIRE(rig.keeper.wait(20s));
  const ReferenceRecord first = rig.on_disk().reference;
  CHECK(first.origin == ReferenceOrigin::first_values);
  CHECK(first.is_known());
  // A new reference at the same temperatures has a new time.
  rig.give(CommandKind::reference);
  const ReferenceRecord second = rig.on_disk().reference;
  CHECK(second.origin == ReferenceOrigin::command);
  CHECK(second.wall_s >= first.wall_s);
  rig.operations.save_state(true);
  REQUIRE(rig.keeper.wait(20s));
  CHECK(rig.on_disk().reference.wall_s == second.wall_s);
}
