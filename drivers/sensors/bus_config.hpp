/// Configuration of a bus of any kind.
#pragma once

#include <string>
#include <variant>

#include "drivers/bus.hpp"
#include "drivers/can/can_config.hpp"
#include "drivers/can/canopen/canopen_config.hpp"
#include "drivers/can/j1939/j1939_config.hpp"
#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

/// Every kind of bus. A configuration has
///   kinds       values of the key `kind` of a [[bus]]
///   name        of the bus
///   outline()   description
/// and compares equal. In addition, a kind has in files of its own:
///   open_PROTOCOL()                  reads the sections    config/buses/PROTOCOL_bus.cpp
///   make_bus_source(configuration)   makes the source      drivers/sensors/PROTOCOL_source.cpp
///   scan_bus(configuration, ...)     scans it live         cli/scan/scan_PROTOCOL.cpp
using BusConfig = std::variant<ModbusBusConfig, CanBusConfig, CanopenBusConfig, J1939BusConfig>;

[[nodiscard]] inline const std::string& name_of(const BusConfig& bus) {
  return std::visit([](const auto& each) -> const std::string& { return each.name; }, bus);
}

[[nodiscard]] inline BusOutline outline_of(const BusConfig& bus) {
  return std::visit([](const auto& each) { return each.outline(); }, bus);
}

}  // namespace thermocomp
