#include "modelling/inspection/inspection.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "config/runs/model_inputs.hpp"
#include "config/runs/robust.hpp"
#include "config/text/units.hpp"
#include "estimator/types.hpp"
#include "modelling/inspection/checks.hpp"

namespace thermocomp::inspection {

namespace {

/// P = of_plain_facts / (1 + (even / score)^steepness): about half at `even`.
struct ScoreCurve {
  std::string_view kind;
  double even;
  double steepness;
};
constexpr std::array<ScoreCurve, 11> score_curves{{
    {"spikes", 1.15, 8},
    {"outliers", 1.15, 8},
    {"sensor_step", 8.0, 6},
    {"sensor_drift", 10.0, 6},
    {"sensor_loose", 22.0, 6},
    {"sensor_swap", 2.0, 4},
    {"stuck", 2.0, 3},
    {"unit", 2.0, 3},
    {"noise", 7.0, 4},
    {"clock", 2.0, 3},
    {"displacement_step", 10.0, 6},
}};
constexpr double of_plain_facts = 0.99;  // coarse, copy, gap: evident in the file

/// Probability of a score, by kind; docs/inspection.md gives the origin of the constants.
double probability_of(const std::string& kind, double score) {
  for (const ScoreCurve& curve : score_curves)
    if (curve.kind == kind)
      return of_plain_facts / (1.0 + std::pow(curve.even / std::max(score, 1e-9), curve.steepness));
  return of_plain_facts;
}

constexpr Eigen::Index rows_of_all_runs_max = 4000;
constexpr Eigen::Index rows_of_a_run_max = 1000;

/// Replaces a stuck stretch by a straight line, so that it does not affect the others.
void bridge(RunFile& run, const Finding& stuck) {
  const std::vector<double>& time_s = run.time_s();
  std::vector<double>& values = run.values[*run.find(stuck.column)];
  const auto row = [&](double at_s) {
    return static_cast<std::size_t>(std::lower_bound(time_s.begin(), time_s.end(), at_s) -
                                    time_s.begin());
  };
  const std::size_t begin = row(stuck.at_s);
  const std::size_t end = std::min(row(stuck.until_s) + 1, run.rows() - 1);
  if (begin >= end || !std::isfinite(values[begin]) || !std::isfinite(values[end])) return;
  const double slope = (values[end] - values[begin]) / (time_s[end] - time_s[begin]);
  for (std::size_t i = begin + 1; i < end; ++i)
    values[i] = values[begin] + slope * (time_s[i] - time_s[begin]);
}

/// Removes the columns of the compensation in a file of `thermocomp export` (an axis' offset with
/// what the controller applied), which are not displacements of the machine.
RunFile of_machine(RunFile run) {
  const std::vector<std::string> columns = run.columns;
  for (const std::string& name : columns) {
    if (!name.ends_with("_offset_um")) continue;
    const std::string axis = name.substr(0, name.size() - std::string_view("_offset_um").size());
    if (std::find(columns.begin(), columns.end(), axis + "_applied_um") == columns.end()) continue;
    for (const char* kind : {"_offset_um", "_applied_um", "_measured_um"}) {
      const auto column = run.find(axis + kind);
      if (!column) continue;
      run.columns.erase(run.columns.begin() + static_cast<std::ptrdiff_t>(*column));
      run.values.erase(run.values.begin() + static_cast<std::ptrdiff_t>(*column));
    }
  }
  return run;
}

/// Keeps only `outputs` of the displacements, and no rows after the selection.
RunFile selected_part(RunFile run, const std::vector<std::string>& outputs) {
  for (std::size_t i = run.columns.size(); i-- > 0;) {
    run.values[i].resize(run.selected_end);
    if (!is_output(run.columns[i]) ||
        std::find(outputs.begin(), outputs.end(), run.columns[i]) != outputs.end())
      continue;
    run.columns.erase(run.columns.begin() + static_cast<std::ptrdiff_t>(i));
    run.values.erase(run.values.begin() + static_cast<std::ptrdiff_t>(i));
  }
  return run;
}

/// The run without values that hide or imitate changes: outliers, which are added to `found`, and
/// stuck displacements, whose jump at the end resembles a new zero.
RunFile without_outliers(RunFile run, std::size_t index, Suspicions& found) {
  check_spikes(run, index, found);
  std::vector<std::string> outputs = run.columns;
  std::erase_if(outputs, [](const std::string& name) { return !is_output(name); });
  leave_out_outliers(run, outputs);
  return run;
}

Eigen::Index rows_max(std::size_t runs) {
  return std::min(
      rows_of_a_run_max,
      std::max<Eigen::Index>(100, rows_of_all_runs_max / static_cast<Eigen::Index>(runs)));
}

}  // namespace

Cleaned without_steps(const std::vector<RunFile>& runs, const std::vector<std::string>& outputs,
                      double probability_min) {
  std::vector<RunFile> despiked;
  Suspicions spikes;
  Suspicions steps;
  for (const RunFile& run : runs)
    despiked.push_back(without_outliers(selected_part(run, outputs), despiked.size(), spikes));
  check_changes(make_recording(despiked, rows_max(runs.size())), Looked::displacements, steps, {});
  Inspection inspection;
  for (Suspicion& each : steps) {
    each.finding.probability = probability_of(each.finding.kind, each.score);
    describe(each.finding, runs);
    inspection.findings.push_back(std::move(each.finding));
  }
  return cleaned(runs, inspection, probability_min);
}

Inspection inspect(const std::vector<RunFile>& given, double probability_min,
                   const std::function<void(double)>& progress) {
  std::vector<RunFile> runs;
  runs.reserve(given.size());
  for (const RunFile& run : given) runs.push_back(of_machine(run));
  Inspection inspection;
  Suspicions suspicions;
  std::vector<RunFile> despiked;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    inspection.runs.push_back(sampling_of(runs[i]));
    check_clock(runs[i], i, inspection.runs.back(), suspicions);
    check_empty(runs[i], i, suspicions);
    check_noises(runs[i], i, suspicions);
    despiked.push_back(without_outliers(runs[i], i, suspicions));
  }
  check_values(runs, suspicions);
  check_time_unit(runs, suspicions);
  for (const Suspicion& each : suspicions)
    if (each.finding.kind == "stuck") bridge(despiked[each.finding.run], each.finding);
  Recording recording = make_recording(despiked, rows_max(runs.size()));
  inspection.groups = groups_of(recording);
  judge_excitation(recording, inspection);
  check_exchanged(recording, suspicions);
  check_units(runs, recording, suspicions);
  check_changes(std::move(recording), Looked::all, suspicions, progress);
  for (Suspicion& each : suspicions) {
    each.finding.score = each.score;
    each.finding.probability = probability_of(each.finding.kind, each.score);
    if (each.finding.probability < probability_min) continue;
    describe(each.finding, runs);
    inspection.findings.push_back(std::move(each.finding));
  }
  std::stable_sort(
      inspection.findings.begin(), inspection.findings.end(),
      [](const Finding& a, const Finding& b) { return a.probability > b.probability; });
  return inspection;
}

namespace {

std::size_t row_of(const RunFile& run, double time_s) {
  const auto& times = run.time_s();
  return static_cast<std::size_t>(std::lower_bound(times.begin(), times.end(), time_s) -
                                  times.begin());
}

/// Replaces the values at the given times by the median of the others around them.
void smooth_out(RunFile& run, std::vector<double>& values, const std::vector<double>& times_s) {
  constexpr std::size_t half_window = 3;
  for (const double time_s : times_s) values[row_of(run, time_s)] = not_a_number;
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
    for (std::size_t row = begin; row < end; ++row) values[row] = not_a_number;
    return "these values were left out";
  }
  if (finding.kind == "copy") {
    std::fill(values.begin(), values.end(), not_a_number);
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
