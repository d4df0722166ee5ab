#include "daemon/daemon.hpp"

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <optional>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "config/daemon/daemon_config.hpp"
#include "daemon/controller_lock.hpp"
#include "daemon/cycle/cycle.hpp"
#include "daemon/cycle/real_time_thread.hpp"
#include "daemon/history/format/database.hpp"
#include "daemon/locks/locks.hpp"
#include "daemon/methods/methods.hpp"
#include "daemon/operations.hpp"
#include "daemon/start_state.hpp"
#include "daemon/supervisor.hpp"
#include "daemon/system/log_setup.hpp"
#include "drivers/controllers/kinds/make_controller.hpp"
#include "drivers/sensors/make_source.hpp"
#include "estimator/checks.hpp"
#include "status/codes.hpp"

namespace thermocomp {
namespace {

/// Longer than one period at the lowest rate, 1 Hz.
constexpr auto cycle_ends_within = std::chrono::seconds(3);

constexpr auto history_ends_within = std::chrono::seconds(4);

Grid make_grid(const LoopConfig& loop) {
  return {std::chrono::steady_clock::now().time_since_epoch(),
          nanoseconds(std::llround(1e9 / loop.rate_hz))};
}

std::vector<std::unique_ptr<SensorSource>> make_sources(const DaemonConfig& config) {
  std::vector<std::unique_ptr<SensorSource>> sources;
  sources.reserve(config.buses.size());
  for (const BusConfig& bus : config.buses) sources.push_back(make_source(bus));
  return sources;
}

std::vector<SensorSource*> pointers(const std::vector<std::unique_ptr<SensorSource>>& sources) {
  std::vector<SensorSource*> list;
  list.reserve(sources.size());
  for (const auto& source : sources) list.push_back(source.get());
  return list;
}

std::unique_ptr<HistoryWriter> make_history(const HistoryConfig& config, const Grid& grid) {
  if (!config.enabled) return nullptr;
  return std::make_unique<HistoryWriter>(config, grid, THERMOCOMP_VERSION);
}

/// Precedes reading the state file, which may move it aside even if the start then fails.
void require_own_history(const DaemonConfig& config) {
  if (!config.history.enabled) return;
  try {
    refuse_foreign_history(config.history.file);
  } catch (const HistoryError& error) {
    const std::string remedy =
        "; move it away, name another file, or install the program that wrote it";
    throw ConfigurationError(
        {{config.file.string(), 0, "history.file", "", error.what() + remedy}});
  }
}

DaemonConfig load(const std::filesystem::path& file) {
  DaemonConfig config = load_daemon_config(file);
  require_own_history(config);
  set_log_level(config.log_level);
  spdlog::info("thermocompd {}: configuration {}, model {} (SHA-256 {})", THERMOCOMP_VERSION,
               config.file.string(), config.model_file.string(), config.model_checksum);
  for (const std::string& remark : config.remarks) spdlog::warn("{}", remark);
  return config;
}

/// The controller's link, unwrapped from a dry run; nullptr: none.
ControllerLink* real_link(ControllerLink& link) {
  auto* dry_run = dynamic_cast<DryRunController*>(&link);
  return dry_run != nullptr ? dry_run->read() : &link;
}

const char* what_stays(const DaemonConfig& config) {
  return config.dry_run ? "dry run: nothing was written to the controller"
                        : "the controller keeps the last offsets";
}

/// Resources locked while this process runs; the history writer holds the history's lock.
struct Locks {
  explicit Locks(const DaemonConfig& config)
      : controller(lock_controller(config.controller, config.dry_run)) {
    try {
      state.emplace(config.state_file);
    } catch (const LockImpossible& problem) {
      warnings.push_back("state file: " + std::string(problem.what()));
    }
  }
  std::vector<NameLock> controller;
  std::optional<FileLock> state;
  std::vector<std::string> warnings;  ///< the state file could not be locked
};

/// The record beside the status socket. A dry run sends nothing and leaves the record untouched.
std::unique_ptr<LastSent> open_last_sent(const DaemonConfig& config,
                                         std::vector<std::string>& warnings) {
  if (config.dry_run) return nullptr;
  try {
    auto record =
        std::make_unique<LastSent>(config.socket.path.string() + ".sent",
                                   controller_identity(config.controller), config.estimator.axes);
    if (!record->problem().empty()) warnings.push_back(record->problem());
    return record;
  } catch (const std::runtime_error& problem) {
    warnings.emplace_back(problem.what());
    return nullptr;
  }
}

}  // namespace

struct Daemon::Parts {
  explicit Parts(const std::filesystem::path& config_file);

  void start();
  void stop() noexcept;

  SignalFile signals;  ///< first member, so that every thread inherits the blocked mask
  DaemonConfig config;
  StatusServer server;
  Locks locks;
  std::unique_ptr<LastSent> last_sent;
  StartState start_state;
  StateKeeper keeper;
  std::vector<std::unique_ptr<SensorSource>> sources;
  std::unique_ptr<ControllerLink> link;
  Grid grid;
  std::unique_ptr<HistoryWriter> history;
  Cycle cycle;
  ServiceManager service;
  EventJournal journal;
  Operations operations;
  Supervisor supervisor;
  RealTimeThread thread;

 private:
  [[nodiscard]] std::unique_ptr<CycleParts> first_parts() const;
  [[nodiscard]] DaemonActions actions();
  void warn(const std::string& warning);
};

Daemon::Parts::Parts(const std::filesystem::path& config_file)
    : config(load(config_file)),
      server(config.socket),
      locks(config),
      last_sent(open_last_sent(config, locks.warnings)),
      start_state(find_start_state(config, last_sent ? last_sent->before() : Offsets{})),
      keeper(config.state_file, start_state.state, start_state.is_on_disk,
             start_state.reference_lost, start_state.reference),
      sources(make_sources(config)),
      link(make_controller(config.controller, config.dry_run)),
      grid(make_grid(config.loop)),
      history(make_history(config.history, grid)),
      cycle(grid, pointers(sources), *link, config.estimator.sensors.size(), first_parts(),
            last_sent.get()),
      operations({config, cycle, keeper, service, history.get(),
                  [this] { return status_line(supervisor.view()); }, &journal,
                  [this] { return server.caller(); }, start_state.state.reference_degC}),
      supervisor({config, cycle, sources, *link, history.get(), keeper, server, signals, service,
                  operations, journal, locks.controller}) {
  if (history) journal.on_event([this](const Event& event) { history->note(event); });
  // Saved now, so that a kill before the first periodic save does not look like a first start.
  keeper.save(start_state.state, std::chrono::steady_clock::now());
  static_cast<void>(keeper.wait(StateKeeper::disk_answers_within));
  for (const std::string& warning : locks.warnings) supervisor.add_warning(warning);
  for (const std::string& warning : start_state.warnings) supervisor.add_warning(warning);
  add_operator_methods(server, actions());
}

std::unique_ptr<CycleParts> Daemon::Parts::first_parts() const {
  auto parts = make_cycle_parts(config, history.get());
  // find_start_state() has removed invalid values.
  THERMOCOMP_ENSURE(parts->estimator.restore(start_state.state).empty());
  if (parts->candidate) parts->candidate->restore(start_state.state);
  return parts;
}

DaemonActions Daemon::Parts::actions() {
  DaemonActions all{[this] { return supervisor.view(); },
                    [this](const Command& asked) { return operations.command(asked); },
                    [this](const auto& candidate) { return operations.reload(candidate); },
                    {},
                    [this](const std::string& name) { operations.note_asked_for(name); }};
  if (auto* bridge = dynamic_cast<BridgeController*>(real_link(*link)))
    all.controller_state = [this, bridge](const nlohmann::json& params) {
      return answer_bridge(*bridge, std::get<BridgeControllerConfig>(config.controller),
                           code_text(cycle.report().mode, config.dry_run).name, params);
    };
  return all;
}

void Daemon::Parts::warn(const std::string& warning) {
  if (warning.empty()) return;
  if (config.loop.real_time == RealTimeRule::require)
    throw RealTimeError(warning + "; loop.real_time = \"require\" forbids to run like this");
  supervisor.add_warning(warning);
}

void Daemon::Parts::start() {
  if (history) history->start();
  for (const auto& source : sources) source->start();
  link->start();
  warn(lock_memory());
  const std::string no_fifo =
      thread.start({config.loop.priority, config.loop.cpu}, [this] { cycle.run(); });
  supervisor.set_real_time(no_fifo.empty());
  warn(no_fifo);
}

void Daemon::Parts::stop() noexcept {
  service.stopping(what_stays(config));
  cycle.stop();
  if (!thread.join_within(cycle_ends_within)) {
    // The thread may be at any point, so nothing is saved: the disk is left as after a kill, and
    // the service manager need not wait for its time-out.
    spdlog::critical("the cycle hangs; ending without it");
    static_cast<void>(flush_log(std::chrono::seconds(1)));
    std::_Exit(EXIT_FAILURE);
  }
  link->stop();
  for (const auto& source : sources) source->stop();
  try {
    operations.settle();
    operations.save_state(true);
    // A write still under way leaves either the old or the new file.
    if (!keeper.wait(StateKeeper::disk_answers_within) || !keeper.error().empty())
      spdlog::error("state not saved: {}", keeper.error());
  } catch (const std::exception& error) {
    spdlog::error("state not saved: {}", error.what());
  }
  cycle.finish_recording();
  if (history && !history->stop_within(history_ends_within)) {
    spdlog::error("the history's disk does not respond: uncommitted records are lost");
    spdlog::info("stopped; {}", what_stays(config));
    static_cast<void>(flush_log(std::chrono::seconds(1)));
    std::_Exit(EXIT_SUCCESS);
  }
  supervisor.note_history();
}

Daemon::Daemon(const std::filesystem::path& config_file)
    : parts_(std::make_unique<Parts>(config_file)) {}
Daemon::~Daemon() = default;

void Daemon::run() {
  try {
    parts_->start();
    parts_->journal.daemon("started", THERMOCOMP_VERSION);
    parts_->supervisor.wait_until_ready();
    parts_->supervisor.run();
  } catch (...) {
    parts_->stop();
    throw;
  }
  parts_->stop();
  spdlog::info("stopped; {}", what_stays(parts_->config));
}

}  // namespace thermocomp
