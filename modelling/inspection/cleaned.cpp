#include <algorithm>
#include <cmath>
#include <limits>

#include "config/runs/robust.hpp"
#include "modelling/inspection/inspection.hpp"

namespace thermocomp::inspection {
namespace {

std::size_t row_of(const RunFile& run, double time_s) {
  const auto& times = run.time_s();
  return static_cast<std::size_t>(std::lower_bound(times.begin(), times.end(), time_s) -
                                  times.begin());
}

/// Replaces the values at the given times by the median of the others around them.
void smooth_out(RunFile& run, std::vector<double>& values, const std::vector<double>& times_s) {
  constexpr std::size_t half_window = 3;
  for (const double time_s : times_s) values[row_of(run, time_s)] = std::nan("");
  const std::vector<double> left = values;
  for (const double time_s : times_s) {
    const std::size_t row = row_of(run, time_s);
    const std::size_t begin = row < half_window ? 0 : row - half_window;
    const std::size_t end = std::min(left.size(), row + half_window + 1);
    values[row] = median({left.begin() + static_cast<std::ptrdiff_t>(begin),
                          left.begin() + static_cast<std::ptrdiff_t>(end)});
  }
}

/// @return description of the change; empty: none
std::string clean(RunFile& run, const Finding& finding) {
  const auto column = run.find(finding.column);
  if (!column) return "";
  std::vector<double>& values = run.values[*column];
  const std::size_t begin = row_of(run, finding.at_s);
  const std::size_t end = std::min(run.rows(), row_of(run, finding.until_s) + 1);
  if (finding.kind == "spikes" || finding.kind == "outliers") {
    smooth_out(run, values, finding.times_s);
    return "these values were replaced by the median of their neighbours";
  }
  if (finding.kind == "sensor_step" || finding.kind == "displacement_step") {
    for (std::size_t row = begin; row < run.rows(); ++row) values[row] -= finding.size;
    return "the step was subtracted";
  }
  if (finding.kind == "sensor_drift") {
    const double duration_s = finding.until_s - finding.at_s;
    for (std::size_t row = begin; row < run.rows(); ++row)
      values[row] -= finding.size * std::min(1.0, (run.time_s()[row] - finding.at_s) / duration_s);
    return "the drift was subtracted as a straight line";
  }
  if (finding.kind == "stuck" || finding.kind == "sensor_loose") {
    for (std::size_t row = begin; row < end; ++row)
      values[row] = std::numeric_limits<double>::quiet_NaN();
    return "these values were left out";
  }
  if (finding.kind == "copy") {
    std::fill(values.begin(), values.end(), std::numeric_limits<double>::quiet_NaN());
    return "it was left out";
  }
  if (finding.kind == "sensor_swap") {
    const auto other = run.find(finding.other);
    if (!other) return "";
    values.swap(run.values[*other]);
    return "they were exchanged back";
  }
  return "";
}

}  // namespace

Cleaned cleaned(const std::vector<RunFile>& runs, const Inspection& inspection,
                double probability_min) {
  Cleaned result{runs, {}};
  for (const Finding& finding : inspection.findings) {
    if (finding.probability < probability_min) continue;
    RunFile& run = result.runs[finding.run];
    const std::string done = clean(run, finding);
    if (!done.empty())
      result.notes.push_back(run.name + ": " + finding.text + " Here " + done + ".");
  }
  return result;
}

}  // namespace thermocomp::inspection
