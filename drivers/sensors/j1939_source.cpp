#include "drivers/can/j1939/j1939_line.hpp"
#include "drivers/sensors/can_interface_source.hpp"
#include "drivers/sensors/make_source.hpp"

namespace thermocomp {

std::unique_ptr<SensorSource> make_bus_source(const J1939BusConfig& bus) {
  return std::make_unique<CanProtocolSource>(bus.name, bus.outline().kind, bus.interface,
                                             bus.reconnect_s, std::make_unique<J1939Line>(bus));
}

}  // namespace thermocomp
