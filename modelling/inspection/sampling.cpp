#include <algorithm>
#include <cmath>

#include "config/runs/robust.hpp"
#include "config/text/units.hpp"
#include "modelling/inspection/checks.hpp"

namespace thermocomp::inspection {
namespace {

// A row or two are lost to a busy logger; three in a row are a gap.
constexpr double gap_steps_min = 3.5;
constexpr double irregular_gap_steps_min = 20.0;
constexpr double hour_s = 3600.0;

std::vector<double> steps_of(const RunFile& run) {
  const std::vector<double>& time_s = run.time_s();
  std::vector<double> steps;
  for (std::size_t row = 1; row < time_s.size(); ++row)
    steps.push_back(time_s[row] - time_s[row - 1]);
  return steps;
}

/// Nine rows in ten are a step apart, give or take a fifth.
bool is_regular(const std::vector<double>& steps, double step_s) {
  const auto near = std::count_if(steps.begin(), steps.end(), [&](double step) {
    return std::abs(step - step_s) <= 0.2 * step_s;
  });
  return 10 * near >= 9 * static_cast<std::ptrdiff_t>(steps.size());
}

/// Whether the temperatures went on over a row as if no time had passed: each moved no more than
/// three times what it moves in a row otherwise.
bool goes_on(const RunFile& run, std::size_t row) {
  std::size_t judged = 0;
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (!is_temperature(run.columns[i])) continue;
    const std::vector<double>& values = run.values[i];
    std::vector<double> moves;
    for (std::size_t k = 1; k < values.size(); ++k)
      moves.push_back(std::abs(values[k] - values[k - 1]));
    const double usual = median(moves);
    const double over = std::abs(values[row] - values[row - 1]);
    if (!std::isfinite(over)) continue;
    // A reading that stands still says nothing.
    if (!(usual > 0)) continue;
    ++judged;
    if (over > 5.0 * usual) return false;
  }
  return judged > 0;
}

}  // namespace

RunSampling sampling_of(const RunFile& run) {
  RunSampling sampling{run.name, run.rows(), 0.0, {}};
  const std::vector<double> steps = steps_of(run);
  if (steps.empty()) return sampling;
  sampling.step_s = median(steps);
  double usual_s = gap_steps_min * sampling.step_s;
  if (!is_regular(steps, sampling.step_s)) {
    std::vector<double> sorted = steps;
    std::sort(sorted.begin(), sorted.end());
    usual_s =
        std::max(irregular_gap_steps_min * sampling.step_s, 3.0 * sorted[sorted.size() * 95 / 100]);
  }
  for (std::size_t i = 0; i < steps.size(); ++i)
    if (steps[i] > usual_s) sampling.gaps.emplace_back(run.time_s()[i], run.time_s()[i + 1]);
  return sampling;
}

void check_clock(const RunFile& run, std::size_t index, const RunSampling& sampling,
                 Suspicions& found) {
  const std::vector<double> steps = steps_of(run);
  const bool regular = !steps.empty() && is_regular(steps, sampling.step_s);
  const auto offer = [&](const char* kind, double from_s, double to_s, double size, double score) {
    Suspicion made;
    made.finding.kind = std::string(kind);
    made.finding.run = index;
    made.finding.at_s = from_s;
    made.finding.until_s = to_s;
    made.finding.size = size;
    made.finding.unit = std::string("s");
    made.score = score;
    found.push_back(made);
  };
  double longest_s = 0.0;
  double longest_from_s = 0.0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double from_s = run.time_s()[i];
    const double to_s = run.time_s()[i + 1];
    const bool gap = std::find(sampling.gaps.begin(), sampling.gaps.end(),
                               std::pair(from_s, to_s)) != sampling.gaps.end();
    const double jump_s = steps[i] - sampling.step_s;
    const double hours = std::round(jump_s / hour_s);
    const bool whole_hours = hours >= 1 && std::abs(jump_s - hours * hour_s) <= 2 * sampling.step_s;
    const bool set_forward = gap && regular && whole_hours && goes_on(run, i + 1);
    // A little, without going back over a row.
    const bool set_back = !gap && regular && steps[i] < 0.3 * sampling.step_s;
    if (set_forward || set_back) {
      offer("clock", from_s, to_s, jump_s, 10.0);
    } else if (gap && steps[i] > longest_s) {
      longest_s = steps[i];
      longest_from_s = from_s;
    }
  }
  if (longest_s > 0) offer("gap", longest_from_s, longest_from_s + longest_s, longest_s, 10.0);
}

}  // namespace thermocomp::inspection
