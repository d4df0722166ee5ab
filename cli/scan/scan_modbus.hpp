/// One Modbus bus, asked once for every channel of the configuration.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "cli/scan/scan_hints.hpp"
#include "cli/scan/scan_report.hpp"
#include "drivers/modbus/modbus_config.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::cli {

/// What a scan needs to know of the sensors, in the order of the configuration.
struct ScanSensors {
  std::vector<std::string> names;
  std::vector<PlausibleRange> ranges;
};

[[nodiscard]] ScanSensors scan_sensors(std::span<const SensorConfig> sensors);

/// Units to look for besides those of the configuration.
struct UnitSearch {
  bool wanted{false};
  int first{1};
  int last{32};
};

/// Reads every channel once, with the requests that the daemon would send; a unit without answer
/// is asked twice and then left alone. Where a value is not plausible or an address is refused, the
/// registers beside it are read too. Nothing is ever written.
/// @param progress  called with a line about what is being done
[[nodiscard]] ScanBus scan_modbus(const ModbusBusConfig& config, const ScanSensors& sensors,
                                  const UnitSearch& search,
                                  const std::function<void(const std::string&)>& progress);

}  // namespace thermocomp::cli
