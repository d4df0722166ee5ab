/// A bus of any kind that brings readings (drivers/sensors/make_source.hpp makes its source).
#pragma once

#include <string>
#include <variant>

#include "drivers/can/can_config.hpp"
#include "drivers/can/canopen/canopen_config.hpp"
#include "drivers/can/j1939/j1939_config.hpp"
#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

using BusConfig = std::variant<ModbusBusConfig, CanBusConfig, CanopenBusConfig, J1939BusConfig>;

[[nodiscard]] inline const std::string& name_of(const BusConfig& bus) {
  return std::visit([](const auto& each) -> const std::string& { return each.name; }, bus);
}

}  // namespace thermocomp
