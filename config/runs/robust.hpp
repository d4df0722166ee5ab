/// Robust statistics.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace thermocomp {

/// Median of the finite values; for an even number the upper one; NaN if there are none.
[[nodiscard]] double median(std::vector<double> values);

/// 1.4826 times the median absolute deviation: standard deviation without outliers. 0 if there is
/// no finite value.
[[nodiscard]] double robust_deviation(std::span<const double> values);

/// Median of the values within `side` rows, symmetric, so that a slope does not bias it.
[[nodiscard]] double median_around(const std::vector<double>& values, std::size_t row,
                                   std::size_t side);

/// Robust line (median of pairwise slopes) through the 2 `side` values after the row, or before it,
/// at the row; NaN if there are too few.
[[nodiscard]] double line_beside(const std::vector<double>& values, std::size_t row,
                                 std::size_t side, bool after);

/// Least and greatest value that a reading of temperature can have: at most 100 K, or ten times the
/// range, beyond those of its rows that change and are not farther apart. (A channel with an open
/// sensor keeps one value.) For a setpoint, which changes in less than a tenth of the rows, beyond
/// all but two rows at each end.
[[nodiscard]] std::pair<double, double> range_of_reading(const std::vector<double>& values_degC);

/// Rows of a signal with stray values, such as an error code of the controller: more than five
/// times the magnitude of all others, in at most one of 200 rows, each alone or all of one value.
/// Empty if nearly all values are 0.
[[nodiscard]] std::vector<std::size_t> stray_rows(const std::vector<double>& values);

/// Rows [begin, end) of one value.
struct StillRows {
  std::size_t begin{0};
  std::size_t end{0};
  [[nodiscard]] std::size_t rows() const noexcept { return end - begin; }
};
/// The longest stretch of one value, and the number of rows of the second longest (at least 1).
[[nodiscard]] std::pair<StillRows, std::size_t> longest_still(const std::vector<double>& values);

}  // namespace thermocomp
