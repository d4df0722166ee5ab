/// When the cycle steps.
#pragma once

#include <chrono>
#include <cstdint>

#include "estimator/types.hpp"

namespace thermocomp {

/// The daemon's time: cycle k is stepped with exactly this time, however late it ran, so a replay
/// needs no clock readings.
struct Grid {
  nanoseconds start{};  ///< CLOCK_MONOTONIC of cycle 0
  nanoseconds period{std::chrono::milliseconds(10)};
  [[nodiscard]] nanoseconds time_of(std::uint64_t cycle) const noexcept {
    return start + period * static_cast<std::int64_t>(cycle);
  }
};

}  // namespace thermocomp
