#include "drivers/sensors/modbus_source.hpp"

#include "drivers/sensors/make_source.hpp"

namespace thermocomp {

ModbusSource::ModbusSource(const ModbusBusConfig& config)
    : name_("mb-" + config.name), connection_(config.line), poller_(config, connection_) {}

ModbusSource::~ModbusSource() {
  stop();
}

void ModbusSource::start() {
  thread_.start(name_, [this] {
    while (!connection_.cancelled()) poller_.act();
  });
}

void ModbusSource::stop() noexcept {
  connection_.cancel();
  thread_.join();
}

std::unique_ptr<SensorSource> make_bus_source(const ModbusBusConfig& bus) {
  return std::make_unique<ModbusSource>(bus);
}

}  // namespace thermocomp
