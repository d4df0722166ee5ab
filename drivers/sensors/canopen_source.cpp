#include "drivers/can/canopen/canopen_line.hpp"
#include "drivers/sensors/can_interface_source.hpp"
#include "drivers/sensors/make_source.hpp"

namespace thermocomp {

std::unique_ptr<SensorSource> make_bus_source(const CanopenBusConfig& bus) {
  return std::make_unique<CanProtocolSource>(bus.name, bus.outline().kind, bus.interface,
                                             bus.reconnect_s, std::make_unique<CanopenLine>(bus));
}

}  // namespace thermocomp
