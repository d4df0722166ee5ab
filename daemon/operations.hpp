/// Operator commands and reloads: handed to the cycle, then saved to disk.
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

/// Main's thread only; never blocks. A command is confirmed once its effect is on disk and survives
/// a restart; if the disk is slower than the client's time-out, the answer reports that. A command
/// that the cycle did not take in time is withdrawn. Configuration, reports and state change
/// together in poll(), once the cycle runs with the new parts.
class Operations {
 public:
  /// All must outlive this.
  struct Parts {
    DaemonConfig& config;  ///< replaced by a reload
    Cycle& cycle;
    StateKeeper& keeper;
    ServiceManager& service;
    HistoryWriter* history;                       ///< null: no history
    std::function<std::string()> status_line;     ///< for the service manager
    EventJournal* journal{nullptr};               ///< null: events are not recorded
    std::function<std::int64_t()> asking_user{};  ///< user ID of the present request; -1: unknown
    /// Reference at start, by column [degC]; a different one was taken since.
    std::map<std::string, double> reference_before_degC{};
  };
  explicit Operations(Parts parts);
  ~Operations();
  Operations(const Operations&) = delete;
  Operations& operator=(const Operations&) = delete;

  /// Marks a reference taken automatically as doubtful because of this later change: "bed_degC
  /// +12.0 K/h".
  void doubt_reference(const std::string& changed);
  /// The person for whom the client gives the next command or reload.
  void note_asked_for(const std::string& name) { asked_for_ = name; }
  /// @throws RpcError when the command cannot be queued
  [[nodiscard]] RpcPending command(const Command& asked);
  /// The pending result throws ConfigurationError, or RpcError if a restart is needed.
  /// @throws RpcError if a reload is under way
  [[nodiscard]] RpcPending reload(
      const std::optional<std::filesystem::path>& candidate = std::nullopt);
  /// Reload by SIGHUP. Any number of signals during a reload cause one further reload.
  void reload_by_signal();
  /// Reason for which the last SIGHUP was refused; empty after a reload that was done.
  [[nodiscard]] const std::string& reload_problem() const noexcept { return reload_problem_; }

  void poll();
  [[nodiscard]] bool is_busy() const noexcept { return cycle_.is_busy(); }
  /// Call after the cycle has ended.
  void settle();

  /// @param at_once  also writes data that is otherwise written periodically
  void save_state(bool at_once);

  [[nodiscard]] CycleHandle& cycle() noexcept { return cycle_; }

 private:
  using Clock = CycleHandle::Clock;
  struct Loaded;
  struct Asking {
    std::int64_t user{-1};
    std::string asked_for{};
  };
  /// Result of a reload, for the client that asked.
  struct ReloadAnswer {
    CycleHandle::Tracked outcome;  ///< none: the files are being read
    std::exception_ptr error;
  };
  struct Reload {
    std::shared_ptr<ReloadAnswer> answer;
    std::shared_ptr<Loaded> loaded;      ///< owned by the thread until it ends
    std::unique_ptr<SideThread> thread;  ///< none: the files are read
    DaemonConfig next;
    bool is_overdue_reported{false};
    std::optional<std::filesystem::path> candidate;
    bool is_asked{false};  ///< by a client, which gets the outcome
    Asking by;
  };

  /// A command's change of the state, not yet on disk.
  struct Save {
    std::uint64_t serial{0};
    Clock::time_point deadline;
  };

  [[nodiscard]] bool is_settled(const Save& save, CommandKind kind) const;
  void begin_reload(const std::optional<std::filesystem::path>& candidate);
  void finish_loading();
  void finish_reload();
  void end_reload();
  void note_refused(const std::string& why);
  void carried_out(const Command& done);
  void report_saved(bool again);
  void note_reference(const PersistentState& state, ReferenceOrigin origin);
  [[nodiscard]] static Event command_event(std::string_view code, const Asking& by);
  void note_asked(const Command& asked, const CycleHandle::Tracked& outcome);
  [[nodiscard]] Asking take_asking(const Command& done);
  [[nodiscard]] Asking asking() const {
    return {parts_.asking_user ? parts_.asking_user() : -1, asked_for_};
  }

  struct Asked {
    Command command;
    CycleHandle::Tracked outcome;
    Asking by;
  };
  Parts parts_;
  CycleHandle cycle_;
  std::optional<Reload> reload_;
  std::optional<std::filesystem::path> candidate_;  ///< named by an operator; empty: none
  bool reload_again_{false};
  std::string reload_problem_;
  std::string asked_for_;
  std::string reported_save_error_;
  std::uint64_t reported_serial_{0};  ///< newest state reported to the estimator as on disk
  CycleHandle::Tracked saved_notice_;
  std::vector<Asked> asked_;  ///< commands under way, in order
};

/// Parts for the configuration, with a recorder if there is a history.
/// @throws InvalidValue
[[nodiscard]] std::unique_ptr<CycleParts> make_cycle_parts(const DaemonConfig& config,
                                                           HistoryWriter* history);

}  // namespace thermocomp
