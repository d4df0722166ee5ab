#include <algorithm>
#include <cmath>
#include <tuple>

#include "config/runs/robust.hpp"
#include "config/text/units.hpp"
#include "modelling/inspection/checks.hpp"

namespace thermocomp::inspection {
namespace {

/// Programs that write on events also produce rows closer in time.
constexpr double set_back_s_min = 10.0;
constexpr double hour_s = 3600.0;

/// True if the temperatures continue over a row as if no time had passed: each changes by at most
/// five times its usual change per row.
bool continues_over(const RunFile& run, std::size_t row) {
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
    if (!(usual > 0)) continue;
    ++judged;
    if (over > 5.0 * usual) return false;
  }
  return judged > 0;
}

using Span = std::pair<double, double>;

/// Stretches without a value, from the last value before to the first after.
std::vector<Span> gaps_of(const RunFile& run, const std::vector<double>& column) {
  std::vector<Span> gaps;
  for (const std::size_t end : ends_of_gaps(run, column)) {
    std::size_t before = end - 1;
    while (!std::isfinite(column[before])) --before;
    gaps.emplace_back(run.time_s()[before], run.time_s()[end]);
  }
  return gaps;
}

/// True if the column has values in at least half of the rows, unlike occasional probings.
bool is_dense(const RunFile& run, std::size_t column) {
  const std::vector<double>& values = run.values[column];
  const auto count = std::count_if(values.begin(), values.end(),
                                   [](double value) { return std::isfinite(value); });
  return 2 * static_cast<std::size_t>(count) >= values.size();
}

}  // namespace

RunSampling sampling_of(const RunFile& run) {
  RunSampling sampling{run.name, run.rows(), 0.0, {}};
  const std::vector<double> steps = steps_of(run);
  if (steps.empty()) return sampling;
  sampling.step_s = median(steps);
  std::vector<Span> gaps;
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (!is_dense(run, i)) continue;
    const std::vector<Span> of_column = gaps_of(run, run.values[i]);
    gaps.insert(gaps.end(), of_column.begin(), of_column.end());
  }
  std::sort(gaps.begin(), gaps.end());
  for (const Span& gap : gaps) {
    if (sampling.gaps.empty() || gap.first >= sampling.gaps.back().second)
      sampling.gaps.push_back(gap);
    else
      sampling.gaps.back().second = std::max(sampling.gaps.back().second, gap.second);
  }
  return sampling;
}

void check_empty(const RunFile& run, std::size_t index, Suspicions& found) {
  const std::vector<Span> without_rows = gaps_of(run, run.time_s());
  Suspicion longest;
  longest.score = 10.0;
  longest.finding.kind = std::string("gap");
  longest.finding.run = index;
  longest.finding.unit = std::string("s");
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (!is_dense(run, i)) continue;
    Finding& finding = longest.finding;
    for (const Span& gap : gaps_of(run, run.values[i])) {
      if (std::find(without_rows.begin(), without_rows.end(), gap) != without_rows.end()) continue;
      if (Span(finding.at_s, finding.until_s) == gap) {
        finding.other.append(finding.other.empty() ? "" : ", ").append(run.columns[i]);
      } else if (gap.second - gap.first > finding.size) {
        finding.column = run.columns[i];
        finding.other.clear();
        std::tie(finding.at_s, finding.until_s) = gap;
        finding.size = gap.second - gap.first;
      }
    }
  }
  if (longest.finding.size > 0) found.push_back(longest);
}

void check_clock(const RunFile& run, std::size_t index, const RunSampling& sampling,
                 Suspicions& found) {
  const std::vector<double> steps = steps_of(run);
  const double gap_s = gap_s_min(run);
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
    const bool gap = steps[i] > gap_s;
    const double jump_s = steps[i] - sampling.step_s;
    const double hours = std::round(jump_s / hour_s);
    const bool whole_hours = hours >= 1 && std::abs(jump_s - hours * hour_s) <= 2 * sampling.step_s;
    const bool set_forward = gap && regular && whole_hours && continues_over(run, i + 1);
    // If set back by less than a row, without a row in between, the rows after it are off the grid
    // too.
    const double over_two_s = i > 0 && i + 1 < steps.size() ? steps[i - 1] + steps[i] + steps[i + 1]
                                                            : 2.0 * sampling.step_s;
    const bool is_row_between =
        std::abs(over_two_s - 2.0 * sampling.step_s) < 0.03 * sampling.step_s;
    const bool set_back = !gap && regular && steps[i] < 0.3 * sampling.step_s && !is_row_between &&
                          sampling.step_s >= set_back_s_min;
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
