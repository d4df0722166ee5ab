/// Live scan of a bus of any kind: values, or the reasons why they are missing.
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

/// Six significant digits.
[[nodiscard]] std::string short_number(double value);

/// Names and limits of the sensors, in the order of the configuration.
struct ScanSensors {
  std::vector<std::string> names;
  std::vector<PlausibleRange> ranges;
  std::vector<double> stale_after_s;
};

/// True if another value may arrive: none came in the last second, and the last is not stale yet.
[[nodiscard]] bool may_come_again(nanoseconds taken_at, double stale_after_s, nanoseconds end,
                                  nanoseconds now);
/// Marks a value as stale by the daemon's rule.
void judge_age(double stale_after_s, ScanChannel& result);

[[nodiscard]] ScanSensors scan_sensors(std::span<const SensorConfig> sensors);

/// Search for units or nodes outside the configuration; the numbers apply to Modbus.
struct UnitSearch {
  bool wanted{false};
  int first{1};
  int last{32};
};

struct ScanTask {
  double listen_s{3.0};  ///< on a bus whose devices send by themselves
  UnitSearch search{};
  std::function<void(const std::string&)> progress;  ///< called with a line of progress
};

/// One overload per kind of bus, in scan_PROTOCOL.cpp. Gives every channel of the configuration the
/// daemon's value, or the reason why it is missing. Sends only what the daemon would send, and
/// changes only settings of the configuration.
[[nodiscard]] ScanBus scan_bus(const ModbusBusConfig& config, const ScanSensors& sensors,
                               const ScanTask& task);
[[nodiscard]] ScanBus scan_bus(const CanBusConfig& config, const ScanSensors& sensors,
                               const ScanTask& task);
[[nodiscard]] ScanBus scan_bus(const CanopenBusConfig& config, const ScanSensors& sensors,
                               const ScanTask& task);
[[nodiscard]] ScanBus scan_bus(const J1939BusConfig& config, const ScanSensors& sensors,
                               const ScanTask& task);

struct SerialHolder {
  std::string name;       ///< "thermocompd (process 812)"; empty: none, or not visible
  bool is_daemon{false};  ///< the process is thermocompd
};

/// Searches the processes that the user may inspect.
[[nodiscard]] SerialHolder holder_of(const std::string& device);

}  // namespace thermocomp::cli
