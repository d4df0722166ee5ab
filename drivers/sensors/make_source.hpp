/// From a bus' configuration to its source.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "drivers/sensors/bus_config.hpp"
#include "drivers/sensors/sensor_source.hpp"

namespace thermocomp {

/// @throws InvalidValue or DriverError for a configuration that cannot work
[[nodiscard]] std::unique_ptr<SensorSource> make_source(const BusConfig& bus);

/// What people are told about a bus before it is opened.
struct BusOutline {
  std::string kind;       ///< as BusHealth tells it
  std::string interface;  ///< "can0"; empty on Modbus
  std::size_t units{0};   ///< as many as its source's health has
  const char* unit_called{"device"};
};
[[nodiscard]] BusOutline outline_of(const BusConfig& bus);

}  // namespace thermocomp
