#include "drivers/sensors/modbus_source.hpp"

#include "drivers/sensors/make_source.hpp"

namespace thermocomp {

ModbusSource::ModbusSource(const ModbusBusConfig& config)
    : name_("mb-" + config.name),
      line_(SharedLine::of(config.line)),
      poller_(config, line_->connection()) {}

ModbusSource::~ModbusSource() {
  stop();
}

void ModbusSource::start() {
  line_->join(poller_, name_);
}

void ModbusSource::stop() noexcept {
  line_->leave(poller_, {});
}

std::unique_ptr<SensorSource> make_bus_source(const ModbusBusConfig& bus) {
  return std::make_unique<ModbusSource>(bus);
}

}  // namespace thermocomp
