#include "config/runs/robust.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/types.hpp"

namespace thermocomp {

double median(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return not_a_number;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double robust_deviation(std::span<const double> values) {
  constexpr double normal = 1.4826;
  std::vector<double> all(values.begin(), values.end());
  const double middle = median(all);
  for (double& value : all) value = std::abs(value - middle);
  const double deviation = normal * median(std::move(all));
  return std::isfinite(deviation) ? deviation : 0.0;
}

double median_around(const std::vector<double>& values, std::size_t row, std::size_t side) {
  const std::size_t half = std::min({side, row, values.size() - 1 - row});
  return median({values.begin() + static_cast<std::ptrdiff_t>(row - half),
                 values.begin() + static_cast<std::ptrdiff_t>(row + half + 1)});
}

double line_beside(const std::vector<double>& values, std::size_t row, std::size_t side,
                   bool after) {
  const std::size_t count = 2 * side;
  if ((after ? values.size() - 1 - row : row) < count) return not_a_number;
  const auto at = [&](std::size_t i) { return after ? values[row + i] : values[row - i]; };
  std::vector<double> slopes;
  for (std::size_t i = 1; i <= side; ++i)
    slopes.push_back((at(i + side) - at(i)) / static_cast<double>(side));
  const double slope = median(slopes);
  std::vector<double> levels;
  for (std::size_t i = 1; i <= count; ++i) levels.push_back(at(i) - slope * static_cast<double>(i));
  return median(levels);
}

std::pair<double, double> range_of_reading(const std::vector<double>& values_degC) {
  constexpr double apart_K_min = 100.0;
  constexpr double ranges_apart = 10.0;
  constexpr std::size_t changing_min = 10;  // one of so many rows
  std::vector<double> changing;
  for (std::size_t row = 1; row < values_degC.size(); ++row)
    if (std::abs(values_degC[row] - values_degC[row - 1]) > 0) changing.push_back(values_degC[row]);
  const bool is_setpoint = changing.size() * changing_min < values_degC.size();
  if (is_setpoint) {
    changing = values_degC;
    if (changing.size() > 4) changing = {values_degC.begin() + 2, values_degC.end() - 2};
    std::erase_if(changing, [](double value) { return !std::isfinite(value); });
  }
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (changing.empty()) return {-infinity, infinity};
  std::sort(changing.begin(), changing.end());
  std::size_t low = is_setpoint ? 0 : changing.size() / 2;
  std::size_t high = is_setpoint ? changing.size() - 1 : low;
  const auto joins = [&](double value_degC) {
    const double range_K = changing[high] - changing[low];
    return std::max(changing[low] - value_degC, value_degC - changing[high]) <=
           std::max(apart_K_min, ranges_apart * range_K);
  };
  while (low > 0 && joins(changing[low - 1])) --low;
  while (high + 1 < changing.size() && joins(changing[high + 1])) ++high;
  while (low > 0 && joins(changing[low - 1])) --low;
  const double beyond_K = std::max(apart_K_min, ranges_apart * (changing[high] - changing[low]));
  return {changing[low] - beyond_K, changing[high] + beyond_K};
}

std::vector<std::size_t> stray_rows(const std::vector<double>& values) {
  constexpr double times_usual = 5.0;
  constexpr std::size_t usual_rows = 200;  // per stray row
  std::vector<double> sizes;
  for (const double each : values)
    if (std::isfinite(each)) sizes.push_back(std::abs(each));
  if (sizes.size() < usual_rows) return {};
  const auto usual = sizes.end() - 1 - static_cast<std::ptrdiff_t>(sizes.size() / usual_rows);
  std::nth_element(sizes.begin(), usual, sizes.end());
  const double limit = times_usual * *usual;
  std::vector<std::size_t> rows;
  double kept = 0.0;
  for (std::size_t row = 0; row < values.size() && *usual > 0.0; ++row) {
    if (std::abs(values[row]) > limit)
      rows.push_back(row);
    else if (std::isfinite(values[row]))
      kept = std::max(kept, std::abs(values[row]));
  }
  // A burst of the machine has courses: a code is one value, or alone in its row.
  const auto is_code = [&](std::size_t i) {
    const bool is_alone = (i == 0 || rows[i - 1] + 1 < rows[i]) &&
                          (i + 1 == rows.size() || rows[i] + 1 < rows[i + 1]);
    return std::abs(values[rows[i]]) > times_usual * kept &&
           (is_alone || values[rows[i]] == values[rows.front()]);
  };
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (!is_code(i)) return {};
  return rows;
}

std::pair<StillRows, std::size_t> longest_still(const std::vector<double>& values) {
  StillRows longest;
  std::size_t second = 1;
  for (std::size_t begin = 0; begin < values.size();) {
    std::size_t end = begin + 1;
    while (end < values.size() && values[end] == values[begin]) ++end;
    if (end - begin > longest.rows()) {
      second = std::max(second, longest.rows());
      longest = {begin, end};
    } else {
      second = std::max(second, end - begin);
    }
    begin = end;
  }
  return {longest, second};
}

}  // namespace thermocomp
