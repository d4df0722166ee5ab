/// One CAN bus, listened to for a while.
#pragma once

#include <functional>
#include <string>

#include "cli/scan_modbus.hpp"
#include "cli/scan_report.hpp"
#include "drivers/sensors/sensor_bus_config.hpp"

namespace thermocomp::cli {

/// Listens for `listen_s` seconds and sends nothing. Every channel gets the newest frame that
/// carries its signal; where none came, the identifiers that did come are named.
[[nodiscard]] ScanBus scan_can(const CanBusConfig& config, const ScanSensors& sensors,
                               double listen_s,
                               const std::function<void(const std::string&)>& progress);

}  // namespace thermocomp::cli
