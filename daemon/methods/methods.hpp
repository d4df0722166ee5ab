/// The methods of the status socket: reads, commands, and who may use them.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "config/daemon/daemon_config.hpp"
#include "daemon/socket/status_server.hpp"
#include "daemon/status/status_view.hpp"
#include "drivers/controllers/kinds/bridge_controller.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// A new reference may be taken only while nothing says that the machine is bent.
/// @return why none should be taken now: an axis is being proved, an offset is applied, the machine
/// warms or cools. Empty: nothing speaks against it, and what is not known does not either.
[[nodiscard]] std::string why_no_reference(const StatusView& view);

/// For how long all temperatures have been watched [s]; less than half an hour says little about
/// slow warming.
[[nodiscard]] double watched_s(const StatusView& view);

/// What the methods need of the daemon behind it.
struct DaemonActions {
  std::function<StatusView()> view;
  /// Gives the command to the cycle; the result is there once it is carried out and would survive a
  /// restart. @throws RpcError
  std::function<RpcPending(const Command&)> command;
  /// The result is there once the cycle runs with the new configuration, and with this candidate
  /// from then on where one is given (an empty path: none).
  /// @throws ConfigurationError or RpcError with what is wrong; the running one then stays
  std::function<RpcPending(const std::optional<std::filesystem::path>& candidate)> reload;
  /// A bridge's report and its answer; empty where the controller is not a bridge. @throws RpcError
  std::function<nlohmann::json(const nlohmann::json&)> controller_state{};
  /// What happened in this run, for `events`.
  std::function<nlohmann::json()> events{};
};

/// Adds every method of CONTRACTS to `server`. @param actions  copied; must stay callable
void add_operator_methods(StatusServer& server, const DaemonActions& actions);

/// The method `controller_state`: from a bridge's JSON to its report, and the answer.
///
/// params: {"session": whole number from 1, "taking": true, "applied_um": {"x": 1.5, "y": null},
/// "signals": {"x_mm": 10.0, ...}}. Numbers are finite, null is "not known". Every axis of the
/// configuration must be there; further axes and signals are what others may want.
/// result: {"epoch": 3, "anew": false, "mode": "compensating", "offsets_um": {"x": 1.5, "y": null}}
/// where null is "leave it as it is".
/// @param mode  as a status calls it
/// @throws RpcError invalid_params (counted), refused
[[nodiscard]] nlohmann::json answer_bridge(BridgeController& bridge,
                                           const BridgeControllerConfig& config,
                                           std::string_view mode, const nlohmann::json& params);

}  // namespace thermocomp
