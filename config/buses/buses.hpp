/// [[bus]], [[device]] and where each [[sensor]] is found on them.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "config/sections/can_database.hpp"
#include "config/sections/canopen_bus.hpp"
#include "config/sections/presets.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/can/can_config.hpp"
#include "drivers/can/canopen/canopen_config.hpp"
#include "drivers/can/j1939/j1939_config.hpp"
#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp::sections {

struct SensorBuses {
  std::vector<ModbusBusConfig> modbus;
  std::vector<CanBusConfig> can;
  std::vector<CanopenBusConfig> canopen;
  std::vector<J1939BusConfig> j1939;
  std::set<std::string> serial_devices;  ///< used by a bus; the controller must not use them
};

/// @param sensors  the [[sensor]] tables in order; their channels get these indices
/// @param presets, dbc_files, eds_files  whose problems are the caller's to tell
[[nodiscard]] SensorBuses read_buses(const TomlTable& root, const std::vector<TomlTable>& sensors,
                                     Presets& presets, DbcFiles& dbc_files, EdsFiles& eds_files);

}  // namespace thermocomp::sections
