/// [controller], [[controller.signal]] and the place of each [[axis]]' offset.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "config/sections/can_signals.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::sections {

struct ControllerReading {
  ControllerConfig config;
  std::vector<std::string> signals;  ///< names, in order
  bool reads_back{true};
  double period_s{0.0};  ///< of the exchange; 0: no exchange
  bool dry_run{false};   ///< nothing is written
  TakenBits can_sent;    ///< frames that are sent to a controller on CAN
};

/// @param axis_tables  the [[axis]] tables, in the order of `axes`; for a travel of all its nodes
/// @param serial_lines  serial lines of the buses
[[nodiscard]] ControllerReading read_controller(
    const TomlTable& table, const std::vector<TomlTable>& axis_tables,
    const std::vector<AxisConfig>& axes, const std::map<std::string, ModbusRtu>& serial_lines);

}  // namespace thermocomp::sections
