/// What is said to a controller over Modbus and when: offsets into its registers, and what it
/// applies and measures out of them.
#pragma once

#include <array>
#include <atomic>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"
#include "drivers/controllers/kinds/modbus/piezo_drive.hpp"
#include "drivers/controllers/write_gate.hpp"
#include "drivers/modbus/shared_line.hpp"
#include "drivers/wait_free_slot.hpp"

namespace thermocomp {

/// Each period: reads everything back and publishes it, then writes the newest command (offsets,
/// then valid bits, then heartbeat, neighbours in one request) - unless an axis stands where
/// nothing sent lately can have taken it: that begins a new epoch and nothing is written
/// (WriteGate); the link is still the same one. After a time-out or a lost connection it is
/// another, after an exception or a pause of the cycle it is not. A controller that reads well and
/// refuses or ignores a write stays online and is asked again a period later: that nothing is
/// ControllerState::written says whether it is written. A piezo leaps to every new offset
/// by way of 0 V: whether it stands where it was set is left to its drive and to the estimator's
/// comparison.
///
/// Of an axis whose controller interpolates along its travel the offsets of all nodes go as one set
/// with a number of its own (ModbusTravel), while all of them are valid. The numbers go on from the
/// one that stands in `end` whenever everything is read anew: a set that was broken off, by whoever
/// wrote before, is never taken for one that is whole.
///
/// Of an axis that is not read back, a new link reads the registers that are written instead, once
/// (WrittenOffsets): applied_um is what stood in them then, NaN where that cannot be read.
///
/// An axis whose command is not valid keeps its register as it is; its valid bit is 0. The
/// heartbeat counts up with every command written and starts anew when its register is full. Valid
/// bits and heartbeat are raw numbers: their scale is not used.
class ModbusDialogue final : public LineUser {
 public:
  /// @param connection  of the configuration's line; outlives the dialogue
  /// @throws InvalidValue for values that cannot be
  ModbusDialogue(ModbusControllerConfig config, ModbusConnection& connection);

  [[nodiscard]] const ModbusLine& line() const noexcept override { return config_.line; }
  [[nodiscard]] nanoseconds next_action_at() const noexcept override;
  /// One period's exchange, connecting and reading everything back before it where needed.
  void act() override;
  /// From any thread: the exchange under way does not try again.
  void end_soon() noexcept { ending_.store(true); }
  [[nodiscard]] bool ending() const noexcept { return ending_.load(); }
  /// Writes the last command, if it may be written.
  void end() override;

  void newest(ControllerState& state) noexcept;  ///< wait-free; one reader
  /// Wait-free; one writer.
  void offer(const OffsetCommand& command, nanoseconds computed_at) noexcept;
  [[nodiscard]] ControllerHealth health() const;  ///< any ordinary thread

 private:
  [[nodiscard]] std::uint64_t link_number() const noexcept;
  bool synchronise();
  /// The numbers of the sets that stand in the registers. False: they could not be read.
  bool read_set_numbers();
  /// What stands in the registers of axes that are not read back. False: asked in vain, to be tried
  /// again.
  bool read_written();
  /// Whether registers that are not read back hold what was just written.
  void compare_written();
  void exchange();
  /// Reads all and begins a new epoch where that is not explained. False: it could not be read.
  bool look();
  void look_for_command();
  bool write_command();
  bool write(const WriteField& request);
  void note_confirmed(nanoseconds now);
  std::vector<WriteField> fields_of(const OffsetCommand& command);
  void add_axis(std::size_t axis, const OffsetCommand& command, std::vector<WriteField>& fields,
                double& valid_bits);
  void plan_values();
  void show_travels() noexcept;
  [[nodiscard]] double written_value(std::size_t axis, double offset_um);
  bool read_all();
  void take(std::span<const std::vector<std::uint16_t>> answers);
  void restart_piezos();
  void show_piezos();
  [[nodiscard]] std::array<double, axes_max> judged_um() const noexcept;
  void publish(bool online);
  void lose(bool same_link);
  void lose_by_write();
  /// Repeats `exchange` as the line's `retries` say. Notes why it failed in the end.
  template <class Request>
  Exchange with_retries(Request&& request);
  void note_refusal(const Exchange& exchange) noexcept;
  bool note_unread(const ReadRequest& request, const Exchange& exchange);  ///< @return false

  const ModbusControllerConfig config_;
  std::vector<ModbusValue> read_values_;  ///< applied offsets, then signals
  std::vector<double*> read_targets_;     ///< where each of them goes
  std::vector<std::size_t> first_;        ///< one an axis: its first offset in command and state
  ReadPlan read_plan_;
  ModbusConnection& connection_;
  WriteGate gate_;
  std::vector<std::optional<PiezoDrive>> piezos_;       ///< one an axis
  std::vector<std::optional<WrittenOffsets>> written_;  ///< one an axis; none: it is read back
  int written_asked_{0};                                ///< in vain, one after the other
  std::array<double, axes_max> shown_V_{};       ///< by the amplifiers of piezos, one an axis
  std::vector<std::vector<double>> shown_sets_;  ///< one an axis: ModbusTravel::applied
  std::vector<std::uint64_t> set_numbers_;       ///< one an axis: of the set written last
  std::uint64_t heartbeat_{0};
  ControllerState state_;  ///< the thread's own
  WaitFreeSlot<ControllerState> states_;
  WaitFreeSlot<OfferedCommand> commands_;
  nanoseconds next_exchange_at_;
  nanoseconds retry_at_;   ///< while not in sync
  std::uint64_t link_{0};  ///< link_number() of what is read back
  bool refused_{false};    ///< the controller itself answered the last exchange, with an exception
  bool write_failed_{false};  ///< in the newest turn
  std::atomic<bool> ending_{false};
  mutable std::mutex health_mutex_;
  ControllerHealth health_;
};

}  // namespace thermocomp
