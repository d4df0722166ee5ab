/// Types shared by drivers, estimator and daemon. All are plain data of fixed size, so that they
/// can be copied through wait-free slots on the real-time thread.
#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>

namespace thermocomp {

using std::chrono::nanoseconds;
using seconds_d = std::chrono::duration<double>;

[[nodiscard]] constexpr double to_seconds(nanoseconds time) noexcept {
  return 1e-9 * static_cast<double>(time.count());
}
[[nodiscard]] constexpr nanoseconds to_nanoseconds(double time_s) noexcept {
  return std::chrono::duration_cast<nanoseconds>(seconds_d(time_s));
}

inline constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
inline constexpr std::size_t axes_max = 16;     ///< axes of one controller
inline constexpr std::size_t signals_max = 48;  ///< signals read from one controller

/// Reason why a reading has no usable value; `none`: the reading is good.
enum class Fault : std::uint8_t {
  none,
  never_read,     ///< nothing received since the start
  stale,          ///< not renewed within its time limit
  open_circuit,   ///< the device reports a broken thermocouple
  short_circuit,  ///< the device reports a shorted thermocouple
  out_of_range,   ///< outside the device's or the configured range, or not a finite number
  too_fast,       ///< changed faster than the structure can change
  stuck,          ///< unchanged for too long
  no_answer,      ///< the unit does not answer or the bus is down
  bad_frame,      ///< the answer was garbled or of the wrong length
  device_busy,
  device_error,  ///< the device answered with an exception, or its status register shows a fault
  unconfirmed    ///< contradicts earlier readings, or is too new, and not yet confirmed
};
inline constexpr std::size_t faults_count = 13;

/// Name of the fault in JSON, history and logs.
[[nodiscard]] std::string_view to_string(Fault fault) noexcept;

/// A temperature with its time (CLOCK_MONOTONIC) and fault.
struct Reading {
  double temp_degC{not_a_number};
  nanoseconds taken_at{};
  Fault fault{Fault::never_read};
};

/// A link epoch holds the number of the link in its low bits (new after a connection, a
/// reconnection, or when offsets are taken again) and above them the number of pauses of that link
/// (unexplained read-back, refused write, stalled cycle).
inline constexpr std::uint32_t epochs_of_a_link = 1u << 20;

/// True if both epochs belong to one link, so that offsets sent in one still count in the other.
[[nodiscard]] constexpr bool is_same_link(std::uint32_t a, std::uint32_t b) noexcept {
  return a % epochs_of_a_link == b % epochs_of_a_link;
}

/// Newest report of the controller; NaN where it reports no value.
struct ControllerState {
  nanoseconds taken_at{};
  /// Changes when the link is established, re-established or paused: a command of another epoch was
  /// computed without knowing the offset applied now. 0: never connected.
  std::uint32_t link_epoch{0};
  std::uint64_t read_back_number{0};  ///< sequence number of this read-back
  bool online{false};
  /// The newest offsets were confirmed within the last few periods of the link: answered on Modbus,
  /// sent on CAN, taken by the bridge.
  bool written{false};
  std::array<double, axes_max> applied_um{};  ///< in effect; else registers as read last [um]
  std::array<double, signals_max> signals{};  ///< order of the configuration, unit of the name

  ControllerState() noexcept {
    applied_um.fill(not_a_number);
    signals.fill(not_a_number);
  }
};

/// Offsets that the cycle sends to the controller.
struct OffsetCommand {
  std::array<double, axes_max> offset_um{};  ///< absolute, order of the axes [um]
  std::array<bool, axes_max> valid{};        ///< false: this axis must not be driven
  /// Link epoch of these offsets; a controller link sends only offsets of its own epoch.
  std::uint32_t link_epoch{0};
  /// ControllerState::read_back_number that they were computed from; the link does not use them to
  /// move an axis away from a newer read-back.
  std::uint64_t read_back_number{0};
};

/// Commands of an operator or of the CNC program. `stop` comes from the daemon before it ends:
/// offsets to zero; the operator's switch keeps its state. `release` ends a latched mismatch or an
/// unknown start of an axis; `accept` confirms the unconfirmed reading of a sensor; `saved`: a
/// state with this offset of the axis is on disk.
enum class CommandKind : std::uint8_t {
  enable,
  disable,
  reference,
  measured,
  cycle_end,
  prove,
  stop,
  release,
  accept,
  saved
};
inline constexpr std::size_t command_kinds_count = 10;
[[nodiscard]] std::string_view to_string(CommandKind kind) noexcept;

/// Origin of a `measured` value.
enum class MeasuredSource : std::uint8_t {
  probe,  ///< a probe or indicator on the machine
  part,   ///< a measured part
  wear    ///< a measured part, and its negative is already entered at the controller
};
inline constexpr std::size_t measured_sources_count = 3;
[[nodiscard]] std::string_view to_string(MeasuredSource source) noexcept;

struct Command {
  CommandKind kind{CommandKind::enable};
  std::uint32_t axis{0};  ///< index of the axis; `accept`: of the sensor
  double value_um{0.0};   ///< of `measured`, `prove` and `saved` [um]
  // Only for `measured`:
  std::uint32_t sd_nm{0};  ///< standard deviation; 0: as configured
  std::uint32_t ago_s{0};  ///< time since the tool was in the measured state
  MeasuredSource source{MeasuredSource::probe};
};

/// Source of an axis' first offset on a link; after `unknown` the best first.
enum class StartEvidence : std::uint8_t {
  unknown,    ///< none; the axis is not driven
  read_back,  ///< the controller reports the offset that it applies
  registers,  ///< the written registers, read when the link began
  record,     ///< the last-sent record of the previous process
  corridor,   ///< the state file, in a corridor around which the sent offset stayed
  released    ///< zero, set by an operator at the controller
};
/// Name in JSON.
[[nodiscard]] std::string_view to_string(StartEvidence evidence) noexcept;

/// Time of a step.
struct StepTime {
  nanoseconds now{};
  double dt_s{0.0};   ///< since the previous step; 0 at the first
  bool first{false};  ///< no earlier step, not even of an adopted estimator
};

enum class Mode : std::uint8_t {
  starting,  ///< never compensated since the start; offsets stay
  disabled,  ///< by an operator or the controller's switch; offsets at zero or on the way
  compensating,
  holding,         ///< inputs or controller lost: offsets stay
  ramping_to_zero  ///< daemon stopping, or holding for hold_s with on_loss = ramp_to_zero
};
[[nodiscard]] std::string_view to_string(Mode mode) noexcept;

/// Reasons and warnings of a step; a set of bits.
enum class Reason : std::uint32_t {
  operator_disabled = 1u << 0,
  controller_disabled = 1u << 1,  ///< disable_signal is 1
  block_lost = 1u << 2,           ///< no good sensor in a block that the model needs
  signal_lost = 1u << 3,          ///< a signal that the model needs, or disable_signal, is missing
  no_reference = 1u << 4,
  controller_offline = 1u << 5,
  not_synced = 1u << 6,  ///< the applied offset is not known yet
  mismatch = 1u << 7,    ///< applied and sent differ
  cutting = 1u << 8,     ///< hold_while_cutting holds the offset
  at_bound = 1u << 9,
  applied_out_of_bound = 1u << 10,  ///< read-back beyond all our bounds: axis is not driven
  block_estimated = 1u << 11,       ///< a warning: compensating with an estimate of a lost block
  mismatch_latched = 1u << 12,      ///< unexplained read-backs: not driven until released
  no_target = 1u << 13,             ///< the model's displacement is not finite
  outside_domain = 1u << 14,
  sensor_suspected = 1u << 15,    ///< a warning: good values that the neighbours contradict
  not_written = 1u << 16,         ///< the controller answers, but confirms no write of offsets
  sensor_unconfirmed = 1u << 17,  ///< an unconfirmed reading contradicts the earlier ones
  start_unknown = 1u << 18        ///< the last sent offset is not known
};
inline constexpr std::size_t reasons_count = 19;
[[nodiscard]] std::string_view to_string(Reason reason) noexcept;

/// True if a set of reasons (Report::reasons) holds `reason`.
[[nodiscard]] constexpr bool has_reason(std::uint32_t reasons, Reason reason) noexcept {
  return (reasons & static_cast<std::uint32_t>(reason)) != 0;
}

}  // namespace thermocomp
