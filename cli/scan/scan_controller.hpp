/// Reads every register and signal of the controller once.
#pragma once

#include <functional>
#include <string>

#include "cli/scan/scan_report.hpp"
#include "config/daemon/daemon_config.hpp"

namespace thermocomp::cli {

/// Reads every configured value, including those that the daemon writes. On CAN it only listens.
///
/// To test whether a Modbus controller accepts writes, the registers' present values are written
/// back as the daemon would. This moves nothing if every axis already applies the value in its
/// register; otherwise, or while a daemon runs, nothing is written and the result says so.
/// @param listen_s  listening time on CAN
/// @param writes_back  false: nothing is written
/// @param progress  called with a line of progress
/// @return nullopt if nothing can be read: no controller, or one that calls the daemon (the reason
///         goes to `progress`)
[[nodiscard]] std::optional<ScanController> scan_controller(
    const DaemonConfig& config, double listen_s, bool writes_back,
    const std::function<void(const std::string&)>& progress);

}  // namespace thermocomp::cli
