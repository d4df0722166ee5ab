#include "drivers/modbus/shared_line.hpp"
#include "drivers/sensors/make_source.hpp"
#include "drivers/sensors/modbus_poller.hpp"

namespace thermocomp {
namespace {

/// Thermocouples on one Modbus line (TCP or RTU), polled by the line's thread.
class ModbusSource final : public SensorSource {
 public:
  explicit ModbusSource(const ModbusBusConfig& config)
      : name_("mb-" + config.name),
        line_(SharedLine::of(config.line)),
        poller_(config, line_->connection()) {}
  ~ModbusSource() override { ModbusSource::stop(); }

  void start() override { line_->join(poller_, name_); }
  void stop() noexcept override { line_->leave(poller_, {}); }
  void newest(std::span<Reading> all) noexcept override { poller_.newest(all); }
  [[nodiscard]] BusHealth health() const override { return poller_.health(); }

 private:
  std::string name_;
  std::shared_ptr<SharedLine> line_;
  ModbusPoller poller_;
};

}  // namespace

std::unique_ptr<SensorSource> make_bus_source(const ModbusBusConfig& bus) {
  return std::make_unique<ModbusSource>(bus);
}

}  // namespace thermocomp
