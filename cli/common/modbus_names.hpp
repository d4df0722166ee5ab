/// Display names of Modbus values, lines and exceptions, by configuration keywords if any.
#pragma once

#include <string>

#include "drivers/controllers/controller_config.hpp"

namespace thermocomp::cli {

[[nodiscard]] std::string table_name(ModbusTable table);
[[nodiscard]] std::string order_name(WordOrder order);
[[nodiscard]] std::string encoding_name(Encoding encoding);

/// "holding 0..1"
[[nodiscard]] std::string place_name(const ModbusValue& value);
/// "int32 ABCD", "uint16", "bit"
[[nodiscard]] std::string type_name(const ModbusValue& value);
/// Returns the value with an unsigned encoding, for counts and bit fields.
[[nodiscard]] ModbusValue without_sign(ModbusValue value) noexcept;
/// Meaning and unit of a value of a travel's set: "slope" in "um/m", "offset at 400 mm" in "um".
struct TravelValueText {
  std::string what;
  std::string unit;
};
/// @param unit  unit of the axis' offset: "um", "urad"
[[nodiscard]] TravelValueText travel_value_text(const TravelShape& travel, const std::string& unit,
                                                std::size_t index);
/// "127.0.0.1:502", or "/dev/ttyUSB0, 19200 baud, 8N1"
[[nodiscard]] std::string line_name(const ModbusLine& line);

}  // namespace thermocomp::cli
