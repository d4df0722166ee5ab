/// The controller's side, asked once for every register and signal of the configuration.
#pragma once

#include <functional>
#include <string>

#include "cli/scan_report.hpp"
#include "config/daemon_config.hpp"

namespace thermocomp::cli {

/// Reads every place that the configuration names, also those that the daemon writes; with Modbus
/// functions 1 to 4 only. Nothing is ever written.
/// @param progress  called with a line about what is being done
/// @return none where nothing can be read: no controller, one that calls the daemon, or one on CAN;
///         which of the latter two it is, `progress` is told
[[nodiscard]] std::optional<ScanController> scan_controller(
    const DaemonConfig& config, const std::function<void(const std::string&)>& progress);

}  // namespace thermocomp::cli
