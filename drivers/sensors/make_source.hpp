/// From a bus' configuration to its source.
#pragma once

#include <memory>

#include "drivers/sensors/bus_config.hpp"
#include "drivers/sensors/sensor_source.hpp"

namespace thermocomp {

/// A source of one kind: its file PROTOCOL_source.cpp.
/// @throws InvalidValue or DriverError for a configuration that cannot work
[[nodiscard]] std::unique_ptr<SensorSource> make_bus_source(const ModbusBusConfig& bus);
[[nodiscard]] std::unique_ptr<SensorSource> make_bus_source(const CanBusConfig& bus);
[[nodiscard]] std::unique_ptr<SensorSource> make_bus_source(const CanopenBusConfig& bus);
[[nodiscard]] std::unique_ptr<SensorSource> make_bus_source(const J1939BusConfig& bus);

[[nodiscard]] inline std::unique_ptr<SensorSource> make_source(const BusConfig& bus) {
  return std::visit([](const auto& each) { return make_bus_source(each); }, bus);
}

}  // namespace thermocomp
