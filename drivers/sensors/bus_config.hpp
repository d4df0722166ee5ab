/// A bus of any kind that brings readings.
#pragma once

#include <string>
#include <variant>

#include "drivers/bus.hpp"
#include "drivers/can/can_config.hpp"
#include "drivers/can/canopen/canopen_config.hpp"
#include "drivers/can/j1939/j1939_config.hpp"
#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

/// Every kind. A configuration has
///   kinds       what the key `kind` of a [[bus]] may say
///   name        of the bus
///   outline()   its description for people
/// and compares equal. Besides it a kind has, each in a file of its own:
///   open_PROTOCOL()                  reads the sections    config/buses/PROTOCOL_bus.cpp
///   make_bus_source(configuration)   brings the readings   drivers/sensors/PROTOCOL_source.cpp
///   scan_bus(configuration, ...)     looks at it live      cli/scan/scan_PROTOCOL.cpp
using BusConfig = std::variant<ModbusBusConfig, CanBusConfig, CanopenBusConfig, J1939BusConfig>;

[[nodiscard]] inline const std::string& name_of(const BusConfig& bus) {
  return std::visit([](const auto& each) -> const std::string& { return each.name; }, bus);
}

[[nodiscard]] inline BusOutline outline_of(const BusConfig& bus) {
  return std::visit([](const auto& each) { return each.outline(); }, bus);
}

}  // namespace thermocomp
