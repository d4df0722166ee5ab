/// What operators and SIGHUP ask for: commands and reloads on their way to the cycle and to the
/// disk.
#pragma once

#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"
#include "daemon/cycle/cycle_handle.hpp"
#include "daemon/history/writing/history_writer.hpp"
#include "daemon/socket/rpc.hpp"
#include "daemon/state/state_file.hpp"
#include "daemon/status/event_journal.hpp"
#include "daemon/system/service_manager.hpp"
#include "daemon/threads/side_thread.hpp"

namespace thermocomp {

/// Main's thread only; nothing waits. What was confirmed to an operator survives a restart: a
/// command is called done only when it is on disk (where that takes longer than a client waits, the
/// answer says so), and one that the cycle did not take in time never happens. Configuration,
/// reports and state change together, in poll(), when the cycle has gone over to a new parts.
class Operations {
 public:
  /// All of them outlive this.
  struct Parts {
    DaemonConfig& config;  ///< replaced by a reload
    Cycle& cycle;
    StateKeeper& keeper;
    ServiceManager& service;
    HistoryWriter* history;                       ///< none: no history
    std::function<std::string()> status_line;     ///< for the service manager
    EventJournal* journal{nullptr};               ///< none: nothing is noted
    std::function<std::int64_t()> asking_user{};  ///< of the request in hand; -1: nobody known
    /// By column, when the daemon started: what differs from it was taken since.
    std::map<std::string, double> reference_before_degC{};
  };
  explicit Operations(Parts parts);
  ~Operations();
  Operations(const Operations&) = delete;
  Operations& operator=(const Operations&) = delete;

  /// @throws RpcError when it cannot even be begun
  [[nodiscard]] RpcPending command(const Command& asked);
  /// Its result throws ConfigurationError, or RpcError: a restart is needed.
  /// @throws RpcError: a reload is under way
  [[nodiscard]] RpcPending reload(
      const std::optional<std::filesystem::path>& candidate = std::nullopt);
  /// The same for SIGHUP. However many arrive while one is under way, one more follows it.
  void hang_up();

  void poll();
  /// Whether poll() has anything to do.
  [[nodiscard]] bool is_busy() const noexcept { return cycle_.is_busy(); }
  /// After the cycle has ended.
  void settle();

  /// @param at_once  writes even what could wait
  void save_state(bool at_once);

  [[nodiscard]] CycleHandle& cycle() noexcept { return cycle_; }

 private:
  using Clock = CycleHandle::Clock;
  struct Loaded;
  /// What has become of a reload, for the client that asked.
  struct ReloadAnswer {
    CycleHandle::Tracked outcome;  ///< none: the files are being read
    std::exception_ptr error;
  };
  struct Reload {
    std::shared_ptr<ReloadAnswer> answer;
    std::shared_ptr<Loaded> loaded;      ///< the thread's until it has ended
    std::unique_ptr<SideThread> thread;  ///< none: the files are read
    DaemonConfig next;
    bool is_overdue_reported{false};
    std::optional<std::filesystem::path> candidate;
    bool is_asked{false};  ///< by a client, who gets the outcome
    std::int64_t user{-1};
  };

  /// What a command has changed, on its way to the disk.
  struct Save {
    std::uint64_t serial{0};
    Clock::time_point deadline;
  };

  [[nodiscard]] bool is_settled(const Save& save, CommandKind kind) const;
  void begin_reload(const std::optional<std::filesystem::path>& candidate);
  void finish_loading();
  void finish_reload();
  void end_reload();
  void carried_out(const Command& done);
  void tell_saved(bool again);
  void note_reference(const PersistentState& state, ReferenceOrigin origin);
  void note_asked(const Command& asked, const CycleHandle::Tracked& outcome);
  [[nodiscard]] std::int64_t take_asking(const Command& done);
  [[nodiscard]] std::int64_t asking_user() const {
    return parts_.asking_user ? parts_.asking_user() : -1;
  }

  struct Asked {
    Command command;
    CycleHandle::Tracked outcome;
    std::int64_t user{-1};
  };
  Parts parts_;
  CycleHandle cycle_;
  std::optional<Reload> reload_;
  std::optional<std::filesystem::path> candidate_;  ///< that an operator named, empty: none
  bool reload_again_{false};
  std::string reported_save_error_;
  std::uint64_t reported_serial_{0};  ///< of the state that the estimator knows to be on disk
  CycleHandle::Tracked saved_notice_;
  std::vector<Asked> asked_;  ///< commands on their way, in order
};

/// Parts for the configuration, with a recorder where there is a history.
/// @throws InvalidValue
[[nodiscard]] std::unique_ptr<CycleParts> make_cycle_parts(const DaemonConfig& config,
                                                           HistoryWriter* history);

}  // namespace thermocomp
