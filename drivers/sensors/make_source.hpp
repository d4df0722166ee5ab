/// Factory of sources from bus configurations.
#pragma once

#include <memory>

#include "drivers/bus.hpp"
#include "drivers/sensors/bus_config.hpp"

namespace thermocomp {

/// One overload per kind of bus, in PROTOCOL_source.cpp.
/// @throws InvalidValue or DriverError for a configuration that cannot work
[[nodiscard]] std::unique_ptr<SensorSource> make_bus_source(const ModbusBusConfig& bus);
[[nodiscard]] std::unique_ptr<SensorSource> make_bus_source(const CanBusConfig& bus);
[[nodiscard]] std::unique_ptr<SensorSource> make_bus_source(const CanopenBusConfig& bus);
[[nodiscard]] std::unique_ptr<SensorSource> make_bus_source(const J1939BusConfig& bus);

[[nodiscard]] inline std::unique_ptr<SensorSource> make_source(const BusConfig& bus) {
  return std::visit([](const auto& each) { return make_bus_source(each); }, bus);
}

}  // namespace thermocomp
