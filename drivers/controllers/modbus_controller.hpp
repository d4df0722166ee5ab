/// Offsets into a controller's Modbus registers, and what it applies and measures out of them.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/bus_thread.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/controllers/modbus_layout.hpp"
#include "drivers/controllers/write_gate.hpp"
#include "drivers/modbus/connection.hpp"
#include "drivers/wait_free_slot.hpp"
#include "drivers/wake_event.hpp"

namespace thermocomp {

/// Each period: reads everything back and publishes it, then writes the newest command (offsets,
/// then valid bits, then heartbeat, neighbours in one request) - unless an axis stands where
/// nothing sent lately can have taken it: that begins a new epoch and nothing is written
/// (WriteGate).
///
/// An axis whose command is not valid keeps its register as it is; its valid bit is 0. The
/// heartbeat counts up with every command written and starts anew when its register is full. Valid
/// bits and heartbeat are raw numbers: their scale is not used.
class ModbusController final : public ControllerLink {
 public:
  /// @throws InvalidValue for values that cannot be, DriverError for a line that cannot be
  explicit ModbusController(ModbusControllerConfig config);
  ~ModbusController() override;

  void start() override;
  void stop() noexcept override;
  void newest(ControllerState& state) noexcept override;
  void offer(const OffsetCommand& command) noexcept override;
  [[nodiscard]] ControllerHealth health() const override;

 private:
  void run();
  void pause_until(nanoseconds time) noexcept { wake_.wait_until(time); }
  bool synchronise();
  void exchange();
  void look_for_command();
  bool write_command();
  bool write(const WriteField& request);
  std::vector<WriteField> fields_of(const OffsetCommand& command) const;
  bool read_all();
  void take(std::span<const std::vector<std::uint16_t>> answers);
  void publish(bool online);
  void lose();
  /// Repeats `exchange` as the line's `retries` say. Notes why it failed in the end.
  template <class Request>
  Exchange with_retries(Request&& request);
  [[nodiscard]] std::string describe(const Exchange& exchange) const;

  const ModbusControllerConfig config_;
  std::vector<ModbusValue> read_values_;  ///< applied offsets, then signals
  std::vector<double*> read_targets_;     ///< where each of them goes in state_
  ReadPlan read_plan_;
  ModbusConnection connection_;
  WriteGate gate_;
  std::uint64_t heartbeat_{0};
  ControllerState state_;  ///< the thread's own
  WaitFreeSlot<ControllerState> states_;
  WaitFreeSlot<OffsetCommand> commands_;
  WakeEvent wake_;
  std::atomic<bool> stopping_{false};
  std::mutex done_mutex_;
  std::condition_variable done_changed_;
  bool done_{false};
  mutable std::mutex health_mutex_;
  ControllerHealth health_;
  BusThread thread_;
};

}  // namespace thermocomp
