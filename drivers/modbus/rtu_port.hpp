/// A serial port, opened and set by libmodbus. Only for the .cpp files of this folder.
#pragma once

#include <memory>
#include <string>

#include <modbus/modbus.h>

#include "drivers/modbus/port.hpp"
#include "drivers/modbus/port_wait.hpp"

namespace thermocomp {

class RtuPort final : public ModbusPort {
 public:
  /// @throws DriverError when libmodbus refuses the line
  explicit RtuPort(const ModbusRtu& rtu);
  ~RtuPort() override { close_device(); }

  [[nodiscard]] nanoseconds now() const noexcept override;
  bool open(std::string& why) override;
  void close() noexcept override { close_device(); }
  bool send(std::span<const std::uint8_t> bytes) noexcept override;
  PortWait wait_for_input(nanoseconds deadline) noexcept override;
  PortBytes receive(std::span<std::uint8_t> into) noexcept override;
  bool pause_until(nanoseconds time) noexcept override { return wait_.pause_until(time); }
  void cancel() noexcept override { wait_.cancel(); }
  [[nodiscard]] bool cancelled() const noexcept override { return wait_.cancelled(); }

 private:
  struct ContextDeleter {
    void operator()(modbus_t* context) const noexcept { modbus_free(context); }
  };

  [[nodiscard]] int fd() const noexcept { return modbus_get_socket(context_.get()); }
  void close_device() noexcept;

  ModbusRtu rtu_;
  InterruptibleWait wait_;
  std::unique_ptr<modbus_t, ContextDeleter> context_;
  bool open_{false};
};

}  // namespace thermocomp
