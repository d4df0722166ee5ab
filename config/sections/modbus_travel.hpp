/// [axis.line] and [axis.table] in the registers of a controller on Modbus.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "config/toml/toml_reader.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::sections {

/// Registers that are written, and by what: no register may be written for two purposes.
class WrittenRegisters {
 public:
  void add(const TomlTable& table, std::string_view key, const ModbusValue& value);

 private:
  std::map<int, std::string> used_;
};

/// @param axis  has a travel_table()
[[nodiscard]] ModbusTravel read_modbus_travel(const TomlTable& axis, const LimiterConfig& limiter,
                                              WrittenRegisters& written);

}  // namespace thermocomp::sections
