/// The methods of the status socket: reads, commands, and who may use them.
#pragma once

#include <functional>

#include <nlohmann/json_fwd.hpp>

#include "config/daemon/daemon_config.hpp"
#include "daemon/socket/status_server.hpp"
#include "daemon/status/status_view.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

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

}  // namespace thermocomp
