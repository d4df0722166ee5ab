/// The types that drivers, estimator and daemon share: what a reading is, what the controller
/// reported, what is sent to it. Everything here is plain data of fixed size, so that it can be
/// copied through wait-free slots on the real-time thread.
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

/// Why a reading must not be used; `none` is the only good one.
enum class Fault : std::uint8_t {
  none,
  never_read,     ///< nothing has arrived since the start
  stale,          ///< not renewed within its time
  open_circuit,   ///< the device says the thermocouple is broken
  short_circuit,  ///< the device says the thermocouple is shorted
  out_of_range,   ///< outside the device's or the configured range, or not a finite number
  too_fast,       ///< changed faster than the structure can
  stuck,          ///< the very same value for too long
  no_answer,      ///< the unit does not answer or the bus is down
  bad_frame,      ///< the answer was garbled or of the wrong length
  device_busy,    ///< the device answered "busy"
  device_error,   ///< the device answered with an exception, or its status register says fault
  unconfirmed     ///< contradicts the past, or is too new, and nothing confirms it yet
};
inline constexpr std::size_t faults_count = 13;

/// The fault's name as it stands in JSON, history and logs.
[[nodiscard]] std::string_view to_string(Fault fault) noexcept;

/// A value, when it was taken and whether it may be believed. Times are CLOCK_MONOTONIC.
struct Reading {
  double temp_degC{not_a_number};
  nanoseconds taken_at{};
  Fault fault{Fault::never_read};
};

/// An epoch of a link numbers in its low bits the link itself (connected, reconnected, offsets
/// taken again) and above them the pauses of one and the same link: something was read back that
/// nothing sent explains, a write was refused, or the cycle stood still.
inline constexpr std::uint32_t epochs_of_a_link = 1u << 20;

/// Whether two epochs are of one link, so that what was sent in one still counts in the other.
[[nodiscard]] constexpr bool is_same_link(std::uint32_t a, std::uint32_t b) noexcept {
  return a % epochs_of_a_link == b % epochs_of_a_link;
}

/// What the controller last reported. Values it does not report are NaN.
struct ControllerState {
  nanoseconds taken_at{};
  /// Changes each time the link is (re)established or pauses: a command of another epoch was
  /// computed without knowing what is applied now. 0: never connected.
  std::uint32_t link_epoch{0};
  std::uint64_t look{0};  ///< the link's number of this read-back, counted up
  bool online{false};
  /// A write of the newest offsets was confirmed within the last few periods of the link: answered
  /// on Modbus, sent on CAN, taken by the bridge.
  bool written{false};
  std::array<double, axes_max> applied_um{};  ///< offset in effect, order of the axes [um]
  std::array<double, signals_max> signals{};  ///< order of the configuration, unit of the name

  ControllerState() noexcept {
    applied_um.fill(not_a_number);
    signals.fill(not_a_number);
  }
};

/// What the cycle wants the controller to apply.
struct OffsetCommand {
  std::array<double, axes_max> offset_um{};  ///< absolute, order of the axes [um]
  std::array<bool, axes_max> valid{};        ///< false: this axis must not be driven
  /// The link epoch these offsets belong to; a controller link never sends offsets of another one.
  std::uint32_t link_epoch{0};
  /// The ControllerState they were computed from: an axis is not driven away from where it was seen
  /// last by what did not know of it.
  std::uint64_t look{0};
};

/// What an operator (or the CNC program) asks of the estimator, or the daemon that is about to end
/// (`stop`: offsets to zero and nowhere else; the operator's switch stays as it is). `release` ends
/// a latched mismatch of an axis, or an unknown start; `accept` confirms the unconfirmed reading of
/// a sensor; `saved`: a state with this offset of the axis is on disk.
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

/// Where a `measured` comes from.
enum class MeasuredSource : std::uint8_t {
  probe,  ///< a probe or indicator on the machine
  part,   ///< a part that was measured
  wear    ///< the same, and the operator has entered its negative at the controller already
};
inline constexpr std::size_t measured_sources_count = 3;
[[nodiscard]] std::string_view to_string(MeasuredSource source) noexcept;

struct Command {
  CommandKind kind{CommandKind::enable};
  std::uint32_t axis{
      0};  ///< `measured`, `prove`, `release`, `saved`: index of the axis; `accept`: of the sensor
  double value_um{0.0};  ///< for `measured`, `prove` and `saved` [um]
  // Of `measured`:
  std::uint32_t sd_nm{0};  ///< standard deviation; 0: as configured
  std::uint32_t ago_s{0};  ///< so long ago the tool was where it was measured
  MeasuredSource source{MeasuredSource::probe};
};

/// What an axis' first offset on a link was known by, the best evidence first.
enum class StartEvidence : std::uint8_t {
  unknown,    ///< nothing; the axis is not driven
  read_back,  ///< the controller shows what it applies
  registers,  ///< the registers that are written were read when the link began
  record,     ///< the last-sent record of the process before
  corridor,   ///< the state file, which the offset sent stays beside
  released    ///< an operator has set the offset to zero at the controller
};
/// As it stands in JSON.
[[nodiscard]] std::string_view to_string(StartEvidence evidence) noexcept;

}  // namespace thermocomp
