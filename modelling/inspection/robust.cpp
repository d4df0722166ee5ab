#include "modelling/inspection/robust.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace thermocomp::inspection {

double median(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double robust_deviation(const Eigen::Ref<const Eigen::VectorXd>& values) {
  constexpr double normal = 1.4826;
  std::vector<double> all(values.begin(), values.end());
  const double middle = median(all);
  for (double& value : all) value = std::abs(value - middle);
  const double deviation = normal * median(std::move(all));
  return std::isfinite(deviation) ? deviation : 0.0;
}

double spread(const Eigen::Ref<const Eigen::VectorXd>& values) {
  if (values.size() < 2) return 0.0;
  const double mean = values.mean();
  return std::sqrt((values.array() - mean).square().sum() / static_cast<double>(values.size() - 1));
}

}  // namespace thermocomp::inspection
