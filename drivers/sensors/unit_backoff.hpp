/// Pauses between requests to a unit that does not answer. Pure; the time is passed in.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>

namespace thermocomp {

/// Pauses double from `pause_first` to `pause_max`; an answer ends them at once. From the third
/// failure on they also limit the time-outs of all dead units of the line to `line_share_max` of
/// its time, as far as `stretch_max` times `pause_max` allows.
class UnitBackoff {
 public:
  using nanoseconds = std::chrono::nanoseconds;
  static constexpr double line_share_max = 0.02;
  static constexpr int failures_before_budget = 2;
  static constexpr double stretch_max = 1.8;

  explicit UnitBackoff(nanoseconds pause_first) noexcept : pause_first_(pause_first) {}

  void answered() noexcept {
    failures_ = 0;
    not_before_ = nanoseconds{0};
  }

  /// All attempts failed at `now`.
  /// @param cost        line time of the failed request
  /// @param dead_units  units of the line without answer, with this one
  void failed(nanoseconds now, nanoseconds cost, std::size_t dead_units,
              nanoseconds pause_max) noexcept {
    pause_ = std::min(failures_ == 0 ? pause_first_ : 2 * pause_, pause_max);
    ++failures_;
    nanoseconds pause = pause_;
    if (failures_ > failures_before_budget) {
      const double budget =
          static_cast<double>(cost.count()) * static_cast<double>(dead_units) / line_share_max;
      const auto ceiling = stretch_max * static_cast<double>(pause_max.count());
      pause =
          std::max(pause, nanoseconds{static_cast<nanoseconds::rep>(std::min(budget, ceiling))});
    }
    not_before_ = now + pause;
  }

  [[nodiscard]] bool dead() const noexcept { return failures_ != 0; }
  [[nodiscard]] nanoseconds not_before() const noexcept { return not_before_; }

 private:
  nanoseconds pause_first_;
  nanoseconds pause_{0};
  nanoseconds not_before_{0};
  int failures_{0};
};

}  // namespace thermocomp
