/// A bus of any kind that brings readings, and the list of the kinds.
#pragma once

#include <string>
#include <variant>

#include "drivers/bus.hpp"
#include "drivers/can/can_config.hpp"
#include "drivers/can/canopen/canopen_config.hpp"
#include "drivers/can/j1939/j1939_config.hpp"
#include "drivers/modbus/modbus_config.hpp"

/// Every kind: its protocol, as a preset and functions name it, and the configuration of a bus.
/// Whatever must know all kinds is made from this list; their order is that of messages and of the
/// buses in a configuration. A configuration has
///   kinds       what the key `kind` of a [[bus]] may say
///   name        of the bus
///   outline()   its description for people
/// and compares equal. Besides it a kind has, each in a file of its own that is found by its name:
///   open_PROTOCOL()                  reads the sections    config/buses/PROTOCOL_bus.cpp
///   make_bus_source(configuration)   brings the readings   drivers/sensors/PROTOCOL_source.cpp
///   scan_bus(configuration, ...)     looks at it live      cli/scan/scan_PROTOCOL.cpp
#define THERMOCOMP_BUSES(BUS)    \
  BUS(modbus, ModbusBusConfig)   \
  BUS(can, CanBusConfig)         \
  BUS(canopen, CanopenBusConfig) \
  BUS(j1939, J1939BusConfig)

namespace thermocomp {

namespace detail {
template <class None, class... Buses>
using variant_without_first = std::variant<Buses...>;
}  // namespace detail

#define THERMOCOMP_BUS_TYPE(protocol, Config) , Config
using BusConfig = detail::variant_without_first<void THERMOCOMP_BUSES(THERMOCOMP_BUS_TYPE)>;
#undef THERMOCOMP_BUS_TYPE

[[nodiscard]] inline const std::string& name_of(const BusConfig& bus) {
  return std::visit([](const auto& each) -> const std::string& { return each.name; }, bus);
}

[[nodiscard]] inline BusOutline outline_of(const BusConfig& bus) {
  return std::visit([](const auto& each) { return each.outline(); }, bus);
}

}  // namespace thermocomp
