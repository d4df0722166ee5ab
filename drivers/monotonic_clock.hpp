/// The one clock of the drivers: CLOCK_MONOTONIC as nanoseconds, the time of every Reading.
#pragma once

#include <chrono>

namespace thermocomp {

[[nodiscard]] inline std::chrono::nanoseconds monotonic_now() noexcept {
  return std::chrono::steady_clock::now().time_since_epoch();
}

/// A configured time in seconds as nanoseconds, bounded to a year so that sums never overflow.
[[nodiscard]] inline std::chrono::nanoseconds from_seconds(double time_s) noexcept {
  constexpr double year_s = 365.0 * 86400.0;
  if (!(time_s > 0.0)) return std::chrono::nanoseconds{0};
  return std::chrono::nanoseconds{
      static_cast<std::chrono::nanoseconds::rep>((time_s < year_s ? time_s : year_s) * 1e9)};
}

}  // namespace thermocomp
