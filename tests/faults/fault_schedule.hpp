/// The faults of a life and their times, drawn from its seed in advance.
#pragma once

#include <array>
#include <bitset>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "chance.hpp"

namespace thermocomp::faults {

using std::chrono::nanoseconds;

[[nodiscard]] constexpr double to_s(nanoseconds time) noexcept {
  return 1e-9 * static_cast<double>(time.count());
}
[[nodiscard]] constexpr nanoseconds from_s(double time_s) noexcept {
  return nanoseconds{static_cast<nanoseconds::rep>(time_s * 1e9)};
}

enum class FaultKind : std::uint8_t {
  sensor_open,
  sensor_short,
  sensor_stuck,
  sensor_spiking,
  sensor_drifting,
  sensors_swapped,
  frames_lost,
  frames_doubled,
  frames_late,
  frames_reordered,
  frames_garbled,
  frames_truncated,
  unit_dead,
  unit_reboot,
  unit_busy,
  unit_in_fahrenheit,
  unit_tenfold_too_low,
  unit_not_ready,
  bus_down,
  controller_off,
  controller_rehomed,
  controller_rejecting,
  writes_unanswered,
  controller_slow,
  controller_applies_other,
  read_back_scaled,
  read_back_negated,
  read_back_shifted,
  read_back_drifting,
  read_back_jumped,
  read_back_frozen,
  controller_ignoring,
  second_writer,
  wall_clock_stepped,
  cycle_overrun,
  model_reload,
  daemon_killed,
  main_stands_still,
  history_disk_full,
  history_files_removed
};
inline constexpr std::size_t fault_kinds = 40;
/// Unordered pairs, including a kind with itself (another subject or time).
inline constexpr std::size_t fault_pairs = fault_kinds * (fault_kinds + 1) / 2;

[[nodiscard]] std::string_view name_of(FaultKind kind) noexcept;
[[nodiscard]] std::optional<FaultKind> kind_of(std::string_view name) noexcept;
[[nodiscard]] std::size_t pair_index(FaultKind a, FaultKind b) noexcept;

struct FaultEvent {
  FaultKind kind{};
  nanoseconds begin{};
  nanoseconds end{};        ///< for an instantaneous fault: end of its consequences
  std::size_t subject{0};   ///< sensor, line or unit, modulo their count
  double strength{0.0};     ///< 0..1
  std::uint64_t number{0};  ///< unique in the life

  [[nodiscard]] bool on_at(nanoseconds time) const noexcept { return begin <= time && time < end; }
};

/// Faults that begin close together; no other fault begins before the next episode.
struct Episode {
  nanoseconds begin{};
  nanoseconds end{};  ///< end of its last fault
  std::vector<FaultEvent> faults;
};

struct ScheduleOptions {
  nanoseconds start{};
  nanoseconds length{};
  double seconds_scale{1.0};        ///< below 1 for campaigns at a higher rate
  std::size_t directed_pair{0};     ///< the first two faults of each episode run through all pairs
  std::optional<FaultKind> only{};  ///< no other fault happens
};

class FaultSchedule {
 public:
  FaultSchedule(std::uint64_t seed, const ScheduleOptions& options);

  [[nodiscard]] const std::vector<Episode>& episodes() const noexcept { return episodes_; }
  /// The fault of this kind (and subject, out of `subjects`) active at a time, or nullptr.
  /// Efficient if times increase from call to call.
  [[nodiscard]] const FaultEvent* find(FaultKind kind, nanoseconds time) const noexcept;
  [[nodiscard]] const FaultEvent* find(FaultKind kind, nanoseconds time, std::size_t subject,
                                       std::size_t subjects) const noexcept;
  /// The current or next episode; nullptr after the last.
  [[nodiscard]] const Episode* episode_at(nanoseconds time) const noexcept;
  /// True if this kind, and no other, was active during all of the last `since`.
  [[nodiscard]] bool alone(FaultKind kind, nanoseconds time, nanoseconds since) const noexcept;
  /// End of the last fault at or before `time`; `start` if there was none.
  [[nodiscard]] nanoseconds fault_free_since(nanoseconds time) const noexcept;
  [[nodiscard]] std::bitset<fault_pairs> pairs() const;
  [[nodiscard]] std::array<std::uint64_t, fault_kinds> counts() const;

 private:
  [[nodiscard]] FaultEvent draw(Chance& chance, FaultKind kind, nanoseconds begin, double scale);

  nanoseconds start_;
  std::vector<Episode> episodes_;
  mutable std::size_t cursor_{0};
  std::uint64_t numbers_{0};
};

}  // namespace thermocomp::faults
