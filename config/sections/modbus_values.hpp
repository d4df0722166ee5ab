/// Sections of the daemon's file for Modbus lines and registers.
#pragma once

#include "config/toml/toml_reader.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp::sections {

/// Keys of a line: host, port or device, baud, ..., and timing. Refuses keys of the other kind.
/// @param kind  one of modbus_kinds, or "s7"
[[nodiscard]] ModbusLine read_modbus_line(const TomlTable& table, std::string_view kind);
/// 1..247; with the frames of Modbus TCP also 0 and 255. Required.
[[nodiscard]] int read_unit(const TomlTable& table, const ModbusLine& line);

enum class RegisterUse {
  written,       ///< offset: holding registers
  written_bits,  ///< heartbeat, valid bits: a holding register without scale
  number,        ///< applied offset: holding or input registers
  signal         ///< any table; a bit has no encoding
};
[[nodiscard]] ModbusValue read_modbus_value(const TomlTable& table, RegisterUse use);

/// A value in an S7 data block: `address` is its first byte.
[[nodiscard]] ModbusValue read_s7_value(const TomlTable& table, RegisterUse use);

/// A sensor's channel; keys missing in `sensor` are taken from `device`.
[[nodiscard]] ModbusChannel read_modbus_channel(const TomlTable& sensor, const TomlTable& device);

[[nodiscard]] ModbusRenewal read_modbus_renewal(const TomlTable& table);

/// The smallest and largest value of raw * scale.
[[nodiscard]] Range reach(const ModbusValue& value);
/// Value of one count; for a float its smallest step.
[[nodiscard]] double count_of(const ModbusValue& value);

}  // namespace thermocomp::sections
