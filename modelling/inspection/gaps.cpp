#include "modelling/inspection/gaps.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "config/runs/robust.hpp"

namespace thermocomp::inspection {
namespace {

// A row or two are lost to a busy logger; three in a row are a gap.
constexpr double gap_steps_min = 3.5;
constexpr double irregular_gap_steps_min = 20.0;

}  // namespace

std::vector<double> steps_of(const RunFile& run) {
  const std::vector<double>& time_s = run.time_s();
  std::vector<double> steps;
  for (std::size_t row = 1; row < time_s.size(); ++row)
    steps.push_back(time_s[row] - time_s[row - 1]);
  return steps;
}

bool is_regular(const std::vector<double>& steps, double step_s) {
  const auto near = std::count_if(steps.begin(), steps.end(), [&](double step) {
    return std::abs(step - step_s) <= 0.2 * step_s;
  });
  return 10 * near >= 9 * static_cast<std::ptrdiff_t>(steps.size());
}

double gap_s_min(const RunFile& run) {
  const std::vector<double> steps = steps_of(run);
  if (steps.empty()) return std::numeric_limits<double>::infinity();
  const double step_s = median(steps);
  if (is_regular(steps, step_s)) return gap_steps_min * step_s;
  std::vector<double> sorted = steps;
  std::sort(sorted.begin(), sorted.end());
  return std::max(irregular_gap_steps_min * step_s, 3.0 * sorted[sorted.size() * 95 / 100]);
}

std::vector<std::size_t> ends_of_gaps(const RunFile& run, const std::vector<double>& column) {
  const double least_s = gap_s_min(run);
  std::vector<std::size_t> ends;
  std::optional<std::size_t> last;
  for (std::size_t row = 0; row < column.size(); ++row) {
    if (!std::isfinite(column[row])) continue;
    if (last && run.time_s()[row] - run.time_s()[*last] > least_s) ends.push_back(row);
    last = row;
  }
  return ends;
}

}  // namespace thermocomp::inspection
