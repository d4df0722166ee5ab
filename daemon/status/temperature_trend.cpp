#include "daemon/status/temperature_trend.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp {
namespace {

double seconds(nanoseconds time) {
  return 1e-9 * static_cast<double>(time.count());
}

/// Sums of a straight line through points, as they come.
struct LineSums {
  double count{0.0}, t{0.0}, tt{0.0}, y{0.0}, ty{0.0};
  void add(double time_s, double value) noexcept {
    count += 1.0;
    t += time_s;
    tt += time_s * time_s;
    y += value;
    ty += time_s * value;
  }
  [[nodiscard]] double slope() const noexcept {
    return (count * ty - t * y) / (count * tt - t * t);
  }
};

}  // namespace

bool TemperatureTrend::Change::is_uneven() const noexcept {
  return std::abs(rate_K_per_h) > even_rate_K_per_h_max && farthest_K >= change_K_min;
}

bool TemperatureTrend::is_due(nanoseconds now) const noexcept {
  if (rows_.empty()) return true;
  return now - rows_.back().at >= (rows_.size() < first_rows ? first_pace : pace);
}

void TemperatureTrend::note(nanoseconds now, const std::vector<std::string>& columns,
                            std::span<const InputReport> inputs) {
  if (columns != columns_) rows_.clear();
  columns_ = columns;
  Row& row = rows_.emplace_back();
  row.at = now;
  for (const InputReport& input : inputs)
    row.temps_degC.push_back(input.good ? input.temp_degC : not_a_number);
  while (now - rows_.front().at > window) rows_.pop_front();
}

TemperatureTrend::Change TemperatureTrend::change(std::size_t column, nanoseconds now,
                                                  double temp_degC) const {
  if (!std::isfinite(temp_degC)) return {};
  LineSums sums;
  // Against the present value: differences keep their digits.
  sums.add(0.0, 0.0);
  double first_s = 0.0;
  double farthest_K = 0.0;
  for (const Row& row : rows_) {
    if (row.at >= now || column >= row.temps_degC.size()) continue;
    if (!std::isfinite(row.temps_degC[column])) continue;
    const double time_s = seconds(row.at - now);
    first_s = std::min(first_s, time_s);
    const double difference_K = row.temps_degC[column] - temp_degC;
    farthest_K = std::max(farthest_K, std::abs(difference_K));
    sums.add(time_s, difference_K);
  }
  if (sums.count < 2.0) return {};
  return {3600.0 * sums.slope(), -first_s, farthest_K};
}

}  // namespace thermocomp
