#include "cli/import/clock_shift.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace thermocomp::cli {
namespace {

constexpr std::size_t points_max = 2000;
constexpr std::ptrdiff_t points_min = 20;
constexpr std::size_t columns_max = 16;
constexpr double correlation_min = 0.8;
constexpr double lead_min = 0.15;

/// Changes of a column over `lag` steps of a grid that begins with its first row; over several the
/// noise of a reading is small beside them.
std::vector<double> changes(const RunFile& run, std::size_t column, double step_s,
                            std::size_t lag) {
  std::vector<double> time_s;
  std::vector<double> values;
  for (std::size_t row = 0; row < run.rows(); ++row) {
    if (!std::isfinite(run.values[column][row])) continue;
    time_s.push_back(run.time_s()[row] - run.time_s().front());
    values.push_back(run.values[column][row]);
  }
  std::vector<double> changes;
  if (values.size() < 3) return changes;
  const double end_s = run.time_s().back() - run.time_s().front();
  std::vector<double> on_grid;
  std::size_t i = 0;
  for (double at_s = 0.0; at_s <= end_s; at_s += step_s) {
    while (i + 1 < time_s.size() && time_s[i + 1] <= at_s) ++i;
    double value = values[i];
    if (i + 1 < time_s.size() && at_s > time_s[i])
      value += (values[i + 1] - values[i]) * (at_s - time_s[i]) / (time_s[i + 1] - time_s[i]);
    on_grid.push_back(value);
  }
  for (std::size_t k = lag; k < on_grid.size(); ++k)
    changes.push_back(on_grid[k] - on_grid[k - lag]);
  return changes;
}

/// Correlation of a_i with b_(i - shift).
double correlation(const std::vector<double>& a, const std::vector<double>& b,
                   std::ptrdiff_t shift) {
  const auto size_a = static_cast<std::ptrdiff_t>(a.size());
  const auto size_b = static_cast<std::ptrdiff_t>(b.size());
  double both = 0.0;
  double of_a = 0.0;
  double of_b = 0.0;
  for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, shift); i < std::min(size_a, size_b + shift);
       ++i) {
    const double x = a[static_cast<std::size_t>(i)];
    const double y = b[static_cast<std::size_t>(i - shift)];
    both += x * y;
    of_a += x * x;
    of_b += y * y;
  }
  // The parts that only one recording covers count half.
  double all_a = 0.0;
  double all_b = 0.0;
  for (const double x : a) all_a += x * x;
  for (const double y : b) all_b += y * y;
  const double weight_a = 0.5 * (of_a + all_a);
  const double weight_b = 0.5 * (of_b + all_b);
  return weight_a > 0 && weight_b > 0 ? both / std::sqrt(weight_a * weight_b) : 0.0;
}

void try_pair(const std::vector<double>& a, const std::vector<double>& b, double offset_s,
              const std::string& columns, ClockShift& best) {
  const auto size_a = static_cast<std::ptrdiff_t>(a.size());
  const auto size_b = static_cast<std::ptrdiff_t>(b.size());
  const std::ptrdiff_t common = std::max(points_min, std::min(size_a, size_b) / 3);
  std::vector<double> by_shift;
  std::ptrdiff_t strongest = 0;
  for (std::ptrdiff_t shift = common - size_b; shift <= size_a - common; ++shift) {
    by_shift.push_back(std::abs(correlation(a, b, shift)));
    const auto here = static_cast<std::ptrdiff_t>(by_shift.size()) - 1;
    if (by_shift.back() > by_shift[static_cast<std::size_t>(strongest)]) strongest = here;
  }
  if (by_shift.empty() || !(by_shift[static_cast<std::size_t>(strongest)] > best.correlation))
    return;
  best.correlation = by_shift[static_cast<std::size_t>(strongest)];
  best.shift_s = offset_s + best.step_s * static_cast<double>(strongest + common - size_b);
  best.columns = columns;
  // Beside its peak r falls; where it rises again by more than 0.05, another peak begins.
  best.next = 0.0;
  for (const std::ptrdiff_t way : {-1, 1}) {
    double lowest = best.correlation;
    const auto end = static_cast<std::ptrdiff_t>(by_shift.size());
    for (std::ptrdiff_t i = strongest + way; i >= 0 && i < end; i += way) {
      const double r = by_shift[static_cast<std::size_t>(i)];
      lowest = std::min(lowest, r);
      if (r > lowest + 0.05) best.next = std::max(best.next, r);
    }
  }
}

}  // namespace

bool ClockShift::is_sure() const noexcept {
  return correlation >= correlation_min && correlation - next >= lead_min;
}

std::optional<ClockShift> clock_shift(const RunFile& first, const RunFile& second) {
  const auto length_s = [](const RunFile& run) { return run.time_s().back() - run.time_s()[0]; };
  const auto step_s = [&](const RunFile& run) {
    return length_s(run) / static_cast<double>(std::max<std::size_t>(run.rows(), 2) - 1);
  };
  ClockShift best;
  best.step_s = std::max(
      {step_s(first), step_s(second), std::max(length_s(first), length_s(second)) / points_max});
  if (!(best.step_s > 0)) return std::nullopt;
  const double shorter_s = std::min(length_s(first), length_s(second));
  const auto lag = static_cast<std::size_t>(std::max(1.0, shorter_s / best.step_s / 40));
  const double offset_s = first.time_s().front() - second.time_s().front();
  std::vector<std::vector<double>> of_second;
  for (std::size_t j = 0; j < std::min(second.columns.size(), columns_max); ++j)
    of_second.push_back(second.columns[j] == "time_s" ? std::vector<double>{}
                                                      : changes(second, j, best.step_s, lag));
  for (std::size_t i = 0; i < std::min(first.columns.size(), columns_max); ++i) {
    if (first.columns[i] == "time_s") continue;
    const std::vector<double> a = changes(first, i, best.step_s, lag);
    for (std::size_t j = 0; j < of_second.size(); ++j)
      if (!a.empty() && !of_second[j].empty())
        try_pair(a, of_second[j], offset_s,
                 "'" + first.columns[i] + "' and '" + second.columns[j] + "'", best);
  }
  return best.columns.empty() ? std::nullopt : std::optional(best);
}

}  // namespace thermocomp::cli
