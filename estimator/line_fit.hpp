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

/// Ordinary least squares; the slope is 0 where all samples have one time. O(n), two passes so that
/// long uptimes cost no digits. @pre 1 to smoothing_samples_max samples
[[nodiscard]] inline Line fit_line(std::span<const Sample> samples) noexcept {
  Line line;
  line.origin = samples.front().at;
  const double share = 1.0 / static_cast<double>(samples.size());
  double sum_s = 0.0;
  double sum_K = 0.0;
  for (const Sample& sample : samples) {
    sum_s += 1e-9 * static_cast<double>((sample.at - line.origin).count());
    sum_K += sample.value_K;
  }
  line.center_s = sum_s * share;
  line.mean_K = sum_K * share;
  double spread = 0.0;
  double slant = 0.0;
  for (const Sample& sample : samples) {
    const double from_center_s =
        1e-9 * static_cast<double>((sample.at - line.origin).count()) - line.center_s;
    spread += from_center_s * from_center_s;
    slant += from_center_s * (sample.value_K - line.mean_K);
  }
  if (spread > 0) line.slope_K_per_s = slant / spread;
  return line;
}

}  // namespace thermocomp
