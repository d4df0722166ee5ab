/// Logs changes of reports and health, so that drivers and cycle need not log.
#pragma once

#include <chrono>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/history/writing/history_writer.hpp"
#include "daemon/socket/status_server.hpp"
#include "daemon/status/event_journal.hpp"
#include "drivers/bus.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

/// Main's thread only. Each change is one line; a lasting state is not repeated, and an
/// intermittent outage is one line, with its duration at its end (EventJournal).
class EventLog {
 public:
  /// @param journal  also gets the changes; outlives this
  explicit EventLog(EventJournal& journal) : journal_(journal) {}

  /// The log begins with the first mode other than `starting` (if switched off: once only that
  /// reason is left), or 5 s after the first report, since missing readings at start are not
  /// events.
  void note_report(const Report& report, const EstimatorConfig& config, bool dry_run = false);
  /// @param columns  names of the report's inputs
  void note_estimates(const Report& report, const EstimatorConfig& config,
                      const std::vector<std::string>& columns);
  /// @param frozen_s  by module, see FrozenModules
  void note_frozen(const std::map<std::string, double>& frozen_s);
  void note_bus(const BusHealth& bus);
  void note_controller(const ControllerHealth& controller);
  /// @param messages  HistoryWriter::take_messages()
  void note_history(const HistoryStatistics& history, const std::vector<std::string>& messages);
  void note_missed(std::uint64_t missed);
  void note_failed_sleeps(std::uint64_t failed);
  /// Refused or cut-off clients and missed notifications: at most one line per minute, so that
  /// clients cannot fill the log.
  void note_socket(const SocketStatistics& statistics);
  /// @param is_stalled  true if the log's reader hangs and lines are lost
  void note_log(bool is_stalled);

 private:
  void note_mode(const Report& report, const std::string& mode);
  void note_reason(Reason reason, bool is_given);
  void note_ended_outages();
  void note_sensors(const Report& report, const EstimatorConfig& config);
  void note_suspicion(std::size_t index, const SensorReport& sensor, const std::string& name);
  void note_mismatches(const Report& report, const EstimatorConfig& config);
  /// Reports a controller that returns with another offset in effect, which has moved the tool.
  void note_returns(const Report& report, const EstimatorConfig& config);
  void note_link(const Subject& subject, bool connected, const std::string& error);
  void note_writes(const ControllerHealth& controller);
  void note_state(const Subject& subject, bool connected, const std::string& state);
  /// Adds to the journal and, if it becomes an event, to the log. @param more  only for the log
  void note_fault(const Event& fault, std::string_view more = "");

  EventJournal& journal_;
  bool first_{true};
  nanoseconds settled_at_{};  ///< in report time
  Mode mode_{Mode::starting};
  std::uint32_t reasons_{0};  ///< reported and not over
  std::vector<bool> suspected_;
  std::vector<Fault> faults_;
  std::vector<double> good_degC_;  ///< value of the last report without a fault
  std::vector<bool> clipping_;
  std::vector<std::string> input_states_;
  std::vector<bool> latched_;
  std::vector<double> in_effect_um_;  ///< by axis, when the controller was last seen; NaN: none
  bool away_{false};                  ///< the controller
  bool uncertain_{false};
  std::set<std::string> frozen_;  ///< modules
  std::map<Subject, bool> connected_;
  std::map<Subject, std::string> states_;  ///< of CAN interfaces
  std::uint64_t lost_{0};                  ///< records of the history
  WriteHealth write_;                      ///< when last seen
  std::uint64_t reads_{0};                 ///< when last seen
  bool unwritten_{false};                  ///< reported
  bool late_{false};                       ///< reported
  std::uint64_t missed_{0};
  std::uint64_t failed_sleeps_{0};
  SocketStatistics socket_;
  std::chrono::steady_clock::time_point socket_next_{};
};

}  // namespace thermocomp
