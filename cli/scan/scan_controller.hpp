/// The controller's side, asked once for every register and signal of the configuration.
#pragma once

#include <functional>
#include <string>

#include "cli/scan/scan_report.hpp"
#include "config/daemon/daemon_config.hpp"

namespace thermocomp::cli {

/// Reads every place that the configuration names, also those that the daemon writes. A controller
/// on CAN is listened to.
///
/// Whether a Modbus controller takes writes shows when what stands in the registers is written once
/// more, as the daemon would. That moves nothing where every axis applies what stands in its
/// register; else, and beside a running daemon, nothing is written, and the result says so.
/// @param listen_s  for so long, on CAN
/// @param writes_back  false: nothing is written
/// @param progress  called with a line about what is being done
/// @return none where nothing can be read: no controller, or one that calls the daemon, which
///         `progress` is called
[[nodiscard]] std::optional<ScanController> scan_controller(
    const DaemonConfig& config, double listen_s, bool writes_back,
    const std::function<void(const std::string&)>& progress);

}  // namespace thermocomp::cli
