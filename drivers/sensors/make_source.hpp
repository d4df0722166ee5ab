/// From a bus' configuration to its source.
#pragma once

#include <memory>

#include "drivers/sensors/bus_config.hpp"
#include "drivers/sensors/sensor_source.hpp"

namespace thermocomp {

/// @throws InvalidValue or DriverError for a configuration that cannot work
[[nodiscard]] std::unique_ptr<SensorSource> make_source(const BusConfig& bus);

/// The same of one kind: its file PROTOCOL_source.cpp.
#define THERMOCOMP_DECLARE_SOURCE(protocol, Config) \
  [[nodiscard]] std::unique_ptr<SensorSource> make_bus_source(const Config& bus);
THERMOCOMP_BUSES(THERMOCOMP_DECLARE_SOURCE)
#undef THERMOCOMP_DECLARE_SOURCE

}  // namespace thermocomp
