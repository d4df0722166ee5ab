/// Tables, word orders and encodings as a configuration names them.
#pragma once

#include <string>

#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp::cli {

[[nodiscard]] std::string table_name(ModbusTable table);
[[nodiscard]] std::string order_name(WordOrder order);
[[nodiscard]] std::string encoding_name(Encoding encoding);

}  // namespace thermocomp::cli
