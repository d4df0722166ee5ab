/// The controller's side, asked once for every register and signal of the configuration.
#pragma once

#include <functional>
#include <string>

#include "cli/scan/scan_report.hpp"
#include "config/daemon/daemon_config.hpp"

namespace thermocomp::cli {

/// Reads every place that the configuration names, also those that the daemon writes; with Modbus
/// functions 1 to 4 only. A controller on CAN is listened to. Nothing is ever written or sent.
/// @param listen_s  for so long, on CAN
/// @param progress  called with a line about what is being done
/// @return none where nothing can be read: no controller, or one that calls the daemon, which
///         `progress` is told
[[nodiscard]] std::optional<ScanController> scan_controller(
    const DaemonConfig& config, double listen_s,
    const std::function<void(const std::string&)>& progress);

}  // namespace thermocomp::cli
