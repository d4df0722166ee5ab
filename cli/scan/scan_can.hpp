/// Scan of a controller on CAN.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "cli/scan/scan_report.hpp"
#include "config/daemon/daemon_config.hpp"
#include "drivers/can/can_config.hpp"
#include "drivers/can/can_socket.hpp"

namespace thermocomp::cli {

using FrameCounts = std::map<CanId, std::size_t>;
/// "identifiers on the bus: 0x281 (5) ..."
[[nodiscard]] std::string received_text(const FrameCounts& frames);
/// "0x281 bit 7 length 16 big_endian x 0.01"
[[nodiscard]] std::string place_name(const CanSignal& signal);

/// Decodes `applied` and the signals from the controller's frames. Sends nothing.
[[nodiscard]] ScanController scan_can_controller(
    const DaemonConfig& config, const CanControllerConfig& controller, double listen_s,
    const std::function<void(const std::string&)>& progress);

}  // namespace thermocomp::cli
