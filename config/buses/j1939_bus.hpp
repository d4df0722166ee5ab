/// Sections of the daemon's file for a J1939 bus, its devices and parameters.
#pragma once

#include <string>

#include "config/toml/toml_reader.hpp"
#include "drivers/can/j1939/j1939_config.hpp"

namespace thermocomp::sections {

[[nodiscard]] J1939BusConfig read_j1939_bus(const TomlTable& table, const std::string& name);
/// @param bus  with the previous devices: addresses must be unique
[[nodiscard]] J1939NodeConfig read_j1939_device(const TomlTable& table, const std::string& name,
                                                const J1939BusConfig& bus);
/// Keys missing in `sensor` are taken from `device`.
[[nodiscard]] J1939Channel read_j1939_channel(const TomlTable& sensor, const TomlTable& device);

}  // namespace thermocomp::sections
