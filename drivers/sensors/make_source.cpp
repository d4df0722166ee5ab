#include "drivers/sensors/make_source.hpp"

#include "drivers/can/canopen/canopen_line.hpp"
#include "drivers/can/j1939/j1939_line.hpp"
#include "drivers/sensors/can_protocol_source.hpp"
#include "drivers/sensors/can_source.hpp"
#include "drivers/sensors/modbus_source.hpp"

namespace thermocomp {
namespace {

struct Outline {
  BusOutline operator()(const ModbusBusConfig& bus) const {
    const bool is_tcp = std::holds_alternative<ModbusTcp>(bus.line.link);
    return {is_tcp ? "modbus_tcp" : "modbus_rtu", "", bus.devices.size(), "device"};
  }
  BusOutline operator()(const CanBusConfig& bus) const {
    return {"can", bus.interface, bus.devices.size(), "device"};
  }
  BusOutline operator()(const CanopenBusConfig& bus) const {
    return {"canopen", bus.interface, bus.nodes.size(), "node"};
  }
  BusOutline operator()(const J1939BusConfig& bus) const {
    return {"j1939", bus.interface, bus.nodes.size(), "device"};
  }
};

struct Maker {
  std::unique_ptr<SensorSource> operator()(const ModbusBusConfig& bus) const {
    return std::make_unique<ModbusSource>(bus);
  }
  std::unique_ptr<SensorSource> operator()(const CanBusConfig& bus) const {
    return std::make_unique<CanSource>(bus);
  }
  std::unique_ptr<SensorSource> operator()(const CanopenBusConfig& bus) const {
    return above_frames<CanopenLine>(bus);
  }
  std::unique_ptr<SensorSource> operator()(const J1939BusConfig& bus) const {
    return above_frames<J1939Line>(bus);
  }

 private:
  template <class Protocol, class Bus>
  static std::unique_ptr<SensorSource> above_frames(const Bus& bus) {
    return std::make_unique<CanProtocolSource>(bus.name, Outline{}(bus).kind, bus.interface,
                                               bus.reconnect_s, std::make_unique<Protocol>(bus));
  }
};

}  // namespace

std::unique_ptr<SensorSource> make_source(const BusConfig& bus) {
  return std::visit(Maker{}, bus);
}

BusOutline outline_of(const BusConfig& bus) {
  return std::visit(Outline{}, bus);
}

}  // namespace thermocomp
