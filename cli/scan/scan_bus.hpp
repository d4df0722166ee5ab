/// A bus of any kind, looked at live: the values, and why there is none.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "cli/scan/scan_report.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/sensors/bus_config.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::cli {

/// Of what was read: six digits.
[[nodiscard]] std::string short_number(double value);

/// What a scan needs to know of the sensors, in the order of the configuration.
struct ScanSensors {
  std::vector<std::string> names;
  std::vector<PlausibleRange> ranges;
  std::vector<double> stale_after_s;
};

/// Whether to wait for a value once more: none has come in the last second of the listening, and
/// the daemon would not call this one stale yet.
[[nodiscard]] bool may_come_again(nanoseconds taken_at, double stale_after_s, nanoseconds end,
                                  nanoseconds now);
/// Calls a value stale that the daemon would call so.
void judge_age(double stale_after_s, ScanChannel& result);

[[nodiscard]] ScanSensors scan_sensors(std::span<const SensorConfig> sensors);

/// Units or nodes to look for besides those of the configuration; numbers are of Modbus.
struct UnitSearch {
  bool wanted{false};
  int first{1};
  int last{32};
};

struct ScanTask {
  double listen_s{3.0};  ///< to a bus on which devices send by themselves
  UnitSearch search{};
  std::function<void(const std::string&)>
      progress;  ///< called with a line about what is being done
};

/// Of one kind: its file scan_PROTOCOL.cpp. Every channel of the configuration gets the value that
/// the daemon would have, or why it has none. Only what the daemon itself would send is sent, and
/// nothing is ever set that the configuration does not set.
[[nodiscard]] ScanBus scan_bus(const ModbusBusConfig& config, const ScanSensors& sensors,
                               const ScanTask& task);
[[nodiscard]] ScanBus scan_bus(const CanBusConfig& config, const ScanSensors& sensors,
                               const ScanTask& task);
[[nodiscard]] ScanBus scan_bus(const CanopenBusConfig& config, const ScanSensors& sensors,
                               const ScanTask& task);
[[nodiscard]] ScanBus scan_bus(const J1939BusConfig& config, const ScanSensors& sensors,
                               const ScanTask& task);

/// Who else has a serial port open.
struct SerialHolder {
  std::string name;       ///< "thermocompd (process 812)"; empty: nobody, or it cannot be seen
  bool is_daemon{false};  ///< thermocompd
};

/// Looks through the processes that the user may look into.
[[nodiscard]] SerialHolder holder_of(const std::string& device);

}  // namespace thermocomp::cli
