/// Medians and deviations that a few wild values do not move.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace thermocomp::inspection {

/// Median of the finite values; NaN without any.
[[nodiscard]] double median(std::vector<double> values);
/// 1.4826 times the median distance from the median: the standard deviation of what is normal.
[[nodiscard]] double robust_deviation(const Eigen::Ref<const Eigen::VectorXd>& values);
/// Standard deviation.
[[nodiscard]] double spread(const Eigen::Ref<const Eigen::VectorXd>& values);

}  // namespace thermocomp::inspection
