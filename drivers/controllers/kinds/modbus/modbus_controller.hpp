/// A controller reached over Modbus, spoken to by a thread of its own.
#pragma once

#include <condition_variable>
#include <mutex>

#include "drivers/bus_thread.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/controllers/kinds/modbus/modbus_dialogue.hpp"
#include "drivers/modbus/connection.hpp"
#include "drivers/monotonic_clock.hpp"
#include "drivers/wake_event.hpp"

namespace thermocomp {

class ModbusController final : public ControllerLink {
 public:
  /// @throws InvalidValue for values that cannot be, DriverError for a line that cannot be
  explicit ModbusController(const ModbusControllerConfig& config);
  ~ModbusController() override;

  void start() override;
  void stop() noexcept override;
  void newest(ControllerState& state) noexcept override { dialogue_.newest(state); }
  void offer(const OffsetCommand& command) noexcept override {
    dialogue_.offer(command, monotonic_now());
  }
  [[nodiscard]] ControllerHealth health() const override { return dialogue_.health(); }

 private:
  void run();

  std::string name_;
  ModbusConnection connection_;
  ModbusDialogue dialogue_;
  WakeEvent wake_;
  std::mutex done_mutex_;
  std::condition_variable done_changed_;
  bool done_{false};
  BusThread thread_;
};

}  // namespace thermocomp
