/// Thermocouples behind one Modbus line (TCP or RTU), polled by the line's thread.
#pragma once

#include "drivers/modbus/shared_line.hpp"
#include "drivers/sensors/modbus_poller.hpp"
#include "drivers/sensors/sensor_source.hpp"

namespace thermocomp {

class ModbusSource final : public SensorSource {
 public:
  /// @throws DriverError naming the device and what cannot work
  explicit ModbusSource(const ModbusBusConfig& config);
  ~ModbusSource() override;

  void start() override;
  void stop() noexcept override;
  void newest(std::span<Reading> all) noexcept override { poller_.newest(all); }
  [[nodiscard]] BusHealth health() const override { return poller_.health(); }

 private:
  std::string name_;
  std::shared_ptr<SharedLine> line_;
  ModbusPoller poller_;
};

}  // namespace thermocomp
