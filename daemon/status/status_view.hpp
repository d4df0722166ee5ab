/// The daemon's status at one moment, and the answers of the status socket made from it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "config/daemon/daemon_config.hpp"
#include "daemon/cycle/cycle.hpp"
#include "daemon/history/writing/history_writer.hpp"
#include "daemon/socket/status_server.hpp"
#include "daemon/state/state_file.hpp"
#include "daemon/status/warm_up.hpp"
#include "drivers/bus.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "status/event.hpp"
#include "status/status.hpp"

namespace thermocomp {

/// The data of a status at one moment.
struct StatusView {
  const DaemonConfig& config;
  const Report& report;
  const ControllerState& controller;
  const CycleTiming& timing;
  std::vector<BusHealth> buses;
  ControllerHealth controller_health;
  HistoryStatistics history;
  std::vector<std::string> warnings;
  std::vector<FrozenModule> modules_frozen;
  double uptime_s{0.0};
  bool real_time{false};
  SocketStatistics socket;
  std::vector<Event> ended{};              ///< outages ended in the last minutes, newest first
  const TemperatureTrend* trend{nullptr};  ///< nullptr: temperatures are not watched
  const WarmUp* warm_up{nullptr};          ///< nullptr: axes are not watched; also the next
  const SinceProbing* since_probing{nullptr};
  ReferenceRecord reference{};
  bool reference_lost{false};   ///< see StateKeeper
  double wall_s{not_a_number};  ///< now, since 1970
  /// Time for which every axis has been driven in mode `compensating` [s].
  double compensating_s{not_a_number};
  const ModelContest::Score* contest{nullptr};  ///< nullptr: no candidate runs
};

/// Adds the socket's reading methods but `events`: status, sensors, offsets, timing, model.
/// @param view  copied; called for each answer
void add_status_methods(StatusServer& server, const std::function<StatusView()>& view);

[[nodiscard]] Status status_of(const StatusView& view);
[[nodiscard]] SensorsAnswer sensors_of(const StatusView& view);
[[nodiscard]] OffsetsAnswer offsets_of(const StatusView& view);
/// Status of the candidate; nullopt: none is configured, or it is the model itself.
/// @param contest  nullptr: no candidate runs
[[nodiscard]] std::optional<CandidateStatus> candidate_of(const DaemonConfig& config,
                                                          const ModelContest::Score* contest);
[[nodiscard]] CycleStatus timing_of(const StatusView& view);
/// The answer of `model`: the model file in use.
[[nodiscard]] nlohmann::json model_json(const DaemonConfig& config);
/// One line for systemctl status.
[[nodiscard]] std::string status_line(const StatusView& view);

}  // namespace thermocomp
