/// Main's loop: signals, status socket, watchdog, health, saving.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/locks/locks.hpp"
#include "daemon/operations.hpp"
#include "daemon/socket/status_server.hpp"
#include "daemon/status/event_log.hpp"
#include "daemon/status/frozen_modules.hpp"
#include "daemon/status/status_view.hpp"
#include "daemon/status/warm_up.hpp"
#include "daemon/system/service_manager.hpp"
#include "drivers/bus.hpp"
#include "drivers/controllers/controller_link.hpp"

namespace thermocomp {

/// The daemon's signals as a file descriptor for poll().
class SignalFile {
 public:
  /// Signals since the last call; several SIGHUPs count as one.
  struct Asked {
    int stop{0};  ///< the last SIGTERM or SIGINT; 0: none
    bool reload{false};
  };

  /// Blocks SIGTERM, SIGINT and SIGHUP for this thread and all threads it creates afterwards.
  SignalFile();
  ~SignalFile();
  SignalFile(const SignalFile&) = delete;
  SignalFile& operator=(const SignalFile&) = delete;

  [[nodiscard]] int fd() const noexcept { return fd_; }
  [[nodiscard]] Asked drain() const noexcept;

 private:
  int fd_;
};

/// No call blocks longer than a tick. The watchdog is fed only while the cycle advances.
class Supervisor {
 public:
  /// All must outlive this.
  struct Parts {
    const DaemonConfig& config;
    Cycle& cycle;
    const std::vector<std::unique_ptr<SensorSource>>& sources;
    const ControllerLink& link;
    HistoryWriter* history;  ///< null: no history
    const StateKeeper& keeper;
    StatusServer& server;
    SignalFile& signals;
    ServiceManager& service;
    Operations& operations;
    EventJournal& journal;
    std::vector<NameLock>& locks;
  };
  explicit Supervisor(const Parts& parts);

  /// Adds the warning to every status from now on.
  void add_warning(const std::string& warning);
  void set_real_time(bool real_time) noexcept { real_time_ = real_time; }

  /// Reports readiness to the service manager once the cycle advances.
  /// @throws RealTimeError if it does not
  void wait_until_ready();
  /// Runs until a signal ends it; then, if so configured, ramps the offsets to zero.
  void run();
  /// Logs new messages of the history; to be called once more after its end.
  void note_history();

  [[nodiscard]] StatusView view();

 private:
  using Clock = std::chrono::steady_clock;

  /// @return true if the daemon was asked to stop
  [[nodiscard]] bool turn();
  [[nodiscard]] bool take_signals();
  void note_report();
  void judge_reference(const Report& report);
  void tick();
  void look_at_health();
  void ramp_to_zero();
  [[nodiscard]] bool at_zero();

  Parts parts_;
  EventLog events_;
  TemperatureTrend trend_;
  WarmUp warm_up_;
  SinceProbing since_probing_;
  FrozenModules frozen_modules_;
  std::vector<std::string> warnings_;
  bool real_time_{false};
  Clock::time_point started_{Clock::now()};
  Clock::time_point next_tick_{};
  Clock::time_point next_health_{};
  Clock::time_point next_note_{};
  Clock::time_point idle_until_{Clock::now()};
  double reference_wall_s_;                         ///< of the newest reference seen
  std::optional<Clock::time_point> reference_due_;  ///< when it is judged
  std::uint64_t cycles_seen_{0};
  std::vector<BusHealth> buses_;
  ControllerHealth controller_health_;
};

}  // namespace thermocomp
