/// Medians and deviations that a few wild values do not move.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace thermocomp {

/// Median of the finite values, the upper of two; NaN without any.
[[nodiscard]] double median(std::vector<double> values);

/// 1.4826 times the median distance from the median: the standard deviation of what is normal. 0
/// without a finite value.
[[nodiscard]] double robust_deviation(std::span<const double> values);

/// Median of the values within `side` rows, as many on both sides, so that a slope is no leap.
[[nodiscard]] double median_around(const std::vector<double>& values, std::size_t row,
                                   std::size_t side);

/// Rows [begin, end) of one and the same value.
struct StillRows {
  std::size_t begin{0};
  std::size_t end{0};
  [[nodiscard]] std::size_t rows() const noexcept { return end - begin; }
};
/// The longest such stretch, and how many rows the second longest has (1 at least).
[[nodiscard]] std::pair<StillRows, std::size_t> longest_still(const std::vector<double>& values);

}  // namespace thermocomp
