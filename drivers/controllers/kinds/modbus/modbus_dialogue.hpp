/// Dialogue with a controller over Modbus, run by the line's thread: writes offsets, reads applied
/// offsets and signals.
#pragma once

#include <array>
#include <atomic>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"
#include "drivers/controllers/kinds/modbus/piezo_drive.hpp"
#include "drivers/modbus/shared_line.hpp"

namespace thermocomp {

/// Each period: reads everything back and publishes it, then writes the newest command (offsets,
/// then valid bits, then heartbeat; adjacent registers in one request). If no offset sent lately
/// explains the applied offset of an axis, a new epoch of the same link begins and nothing is
/// written (WriteGate). A time-out or a lost connection begins a new link; an exception or a pause
/// of the cycle does not. A controller that answers reads and refuses or ignores writes stays
/// online and is retried a period later; ControllerState::written shows it. A piezo goes to each
/// new offset via 0 V: its drive and the estimator's comparison check its position.
///
/// For an axis whose controller interpolates along its travel, the offsets of all nodes are written
/// as one numbered set (ModbusTravel) while all of them are valid. Whenever everything is read
/// anew, numbering continues from the number in `end`, so that an incomplete set of an earlier
/// writer never appears complete.
///
/// For an axis without read-back, a new link reads the written registers instead (WrittenOffsets):
/// applied_um is their content at the last read, NaN if they cannot be read. While they hold
/// another value than those written, no write counts as confirmed.
///
/// The register of an axis whose command is not valid is not written; its valid bit is 0. The
/// heartbeat is incremented with every command written and wraps around. Valid bits and heartbeat
/// are raw numbers without scale.
class ModbusDialogue final : public LineUser {
 public:
  /// @param connection  of the configuration's line; outlives the dialogue
  /// @throws InvalidValue for impossible values
  ModbusDialogue(ModbusControllerConfig config, ModbusConnection& connection);

  [[nodiscard]] const ModbusLine& line() const noexcept override { return config_.line; }
  [[nodiscard]] nanoseconds next_action_at() const noexcept override;
  /// One period's exchange; first connects and reads everything back if necessary.
  void act() override;
  /// Ends retries of the present exchange; from any thread.
  void end_soon() noexcept { ending_.store(true); }
  [[nodiscard]] bool ending() const noexcept { return ending_.load(); }
  /// Writes the last command if that is permitted.
  void end() override;

  void newest(ControllerState& state) noexcept;  ///< wait-free; one reader
  /// Wait-free; one writer.
  void offer(const OffsetCommand& command, nanoseconds computed_at) noexcept;
  [[nodiscard]] ControllerHealth health() const;  ///< any ordinary thread

 private:
  [[nodiscard]] std::uint64_t link_number() const noexcept;
  bool synchronise();
  /// Reads the set numbers from the registers. @return false if that failed
  bool read_set_numbers();
  /// Reads the written registers of axes without read-back. @return false to try again
  bool read_written();
  void show_written(std::size_t axis, std::span<const std::uint16_t> words);
  void forget_written() noexcept;
  /// True if registers without read-back hold none of the offsets written; nullopt: unreadable.
  [[nodiscard]] std::optional<bool> has_restarted();
  /// Checks that registers without read-back hold the values just written: of the first command,
  /// then once in WriteGate::patience(). @return false: the link is lost
  [[nodiscard]] bool compare_written();
  void exchange();
  /// Reads all; begins a new epoch if the read-back is unexplained. @return false if reading failed
  bool read_and_judge();
  Exchange read_registers(const ReadRequest& request, std::vector<std::uint16_t>& words);
  std::optional<std::vector<std::uint16_t>> registers_now(const WrittenOffsets& written);
  bool is_cleared();
  [[nodiscard]] bool shows_piezos() const noexcept;
  void take_command();
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
  /// Retries `exchange` as often as the line's `retries`. Records the reason of a failure.
  template <class Request>
  Exchange with_retries(Request&& request);
  void note_refusal(const Exchange& exchange) noexcept;
  bool note_unread(const ReadRequest& request, const Exchange& exchange);  ///< @return false

  const ModbusControllerConfig config_;
  std::vector<ModbusValue> read_values_;  ///< applied offsets, then signals
  std::vector<double*> read_targets_;     ///< their destinations
  std::vector<std::size_t> first_;        ///< one per axis: its first offset in command and state
  ReadPlan read_plan_;
  ModbusConnection& connection_;
  WriteGate gate_;
  std::vector<std::optional<PiezoDrive>> piezos_;       ///< one per axis
  std::vector<std::optional<WrittenOffsets>> written_;  ///< one per axis; none: has a read-back
  int written_asked_{0};                                ///< consecutive failed attempts
  nanoseconds compare_at_{};                            ///< next compare_written() of all
  std::array<double, axes_max> shown_V_{};       ///< voltages of the amplifiers, one per axis
  std::vector<std::vector<double>> shown_sets_;  ///< one per axis: ModbusTravel::applied
  std::vector<std::uint64_t> set_numbers_;       ///< one per axis: of the set written last
  std::uint64_t heartbeat_{0};
  ControllerState state_;  ///< of the thread
  WaitFreeSlot<ControllerState> states_;
  WaitFreeSlot<OfferedCommand> commands_;
  nanoseconds next_exchange_at_;
  nanoseconds retry_at_;   ///< while not synchronised
  std::uint64_t link_{0};  ///< link_number() of the last read-back
  bool refused_{false};    ///< the controller itself answered the last exchange with an exception
  bool write_failed_{false};  ///< in the newest period
  bool write_taken_{false};   ///< the last one was answered
  std::atomic<bool> ending_{false};
  mutable std::mutex health_mutex_;
  ControllerHealth health_;
};

}  // namespace thermocomp
