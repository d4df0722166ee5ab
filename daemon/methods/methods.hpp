/// The methods of the status socket that change something: commands and their permissions.
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

/// The daemon's functions behind the methods.
struct DaemonActions {
  std::function<StatusView()> view;
  /// Queues the command; the result is complete once it is carried out and survives a restart.
  /// @throws RpcError
  std::function<RpcPending(const Command&)> command;
  /// Reloads. The result is complete once the cycle runs with the new configuration and, if given,
  /// this candidate (an empty path: none).
  /// @throws RpcError, the result also ConfigurationError; the running configuration stays in use
  std::function<RpcPending(const std::optional<std::filesystem::path>& candidate)> reload;
  /// A bridge's report and its answer; empty if the controller is not a bridge. @throws RpcError
  std::function<nlohmann::json(const nlohmann::json&)> controller_state{};
  /// Called before each command with the person for whom the client gives it; empty: not named.
  std::function<void(const std::string&)> asked_for{};
};

/// Adds the methods that change something to `server`. @param actions  copied; must stay callable
void add_operator_methods(StatusServer& server, const DaemonActions& actions);

/// Carries out the method `controller_state`: converts a bridge's JSON to its report and returns
/// the answer.
///
/// params: {"session": whole number from 1, "taking": true, "applied_um": {"x": 1.5, "y": null},
/// "signals": {"x_mm": 10.0, ...}}. Numbers are finite, null means "unknown". Every configured axis
/// must be present; other axes and signals are ignored.
/// result: {"epoch": 3, "anew": false, "mode": "compensating", "offsets_um": {"x": 1.5, "y": null}}
/// where null means "leave unchanged".
/// @param mode  its name in the status
/// @throws RpcError invalid_params (counted), refused
[[nodiscard]] nlohmann::json answer_bridge(BridgeController& bridge,
                                           const BridgeControllerConfig& config,
                                           std::string_view mode, const nlohmann::json& params);

}  // namespace thermocomp
