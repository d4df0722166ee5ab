/// Least-squares line through a few samples at real times.
#pragma once

#include <cstddef>
#include <span>

#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

inline constexpr std::size_t smoothing_samples_max = 32;

/// A sample of a temperature or temperature difference.
struct Sample {
  nanoseconds at{};
  double value_K{0.0};
  void visit_state(StateArchive& archive) { archive(at, value_K); }
};

/// value(t) = mean + slope (t - center)
struct Line {
  nanoseconds origin{};  ///< times below are seconds since here
  double center_s{0.0};
  double mean_K{0.0};
  double slope_K_per_s{0.0};

  [[nodiscard]] double at(nanoseconds time) const noexcept {
    const double time_s = 1e-9 * static_cast<double>((time - origin).count());
    return mean_K + slope_K_per_s * (time_s - center_s);
  }
  void visit_state(StateArchive& archive) { archive(origin, center_s, mean_K, slope_K_per_s); }
};

/// A time [s] and a value [K] that are worked on side by side: half the instructions, same bits.
using TimeAndValue = double __attribute__((vector_size(16)));

/// Ordinary least squares; the slope is 0 where all samples have one time. O(n), two passes so that
/// long uptimes cost no digits. @pre 1 to smoothing_samples_max samples
[[nodiscard]] inline Line fit_line(std::span<const Sample> samples) noexcept {
  const nanoseconds origin = samples.front().at;
  TimeAndValue pairs[smoothing_samples_max];
  TimeAndValue sum{0.0, 0.0};
  std::size_t count = 0;
  for (const Sample& sample : samples) {
    const TimeAndValue pair{1e-9 * static_cast<double>((sample.at - origin).count()),
                            sample.value_K};
    pairs[count++] = pair;
    sum += pair;
  }
  const TimeAndValue center = sum * (1.0 / static_cast<double>(static_cast<int>(count)));
  TimeAndValue products{0.0, 0.0};  // of the time with time and value: spread and slant
  for (std::size_t i = 0; i < count; ++i) {
    const TimeAndValue from_center = pairs[i] - center;
    products += TimeAndValue{from_center[0], from_center[0]} * from_center;
  }
  return {origin, center[0], center[1], products[0] > 0 ? products[1] / products[0] : 0.0};
}

}  // namespace thermocomp
