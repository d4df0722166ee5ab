#include "modelling/inspection/recording.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "config/runs/robust.hpp"
#include "config/text/units.hpp"
#include "estimator/types.hpp"

namespace thermocomp::inspection {
namespace {

// A busy logger can lose one or two rows; three in a row are a gap.
constexpr double gap_steps_min = 3.5;
constexpr double irregular_gap_steps_min = 20.0;

using Eigen::Index;

constexpr std::size_t output_rows_min = 20;

std::size_t values_of(const std::vector<double>& column) {
  return static_cast<std::size_t>(
      std::count_if(column.begin(), column.end(), [](double v) { return std::isfinite(v); }));
}

bool is_usable(const std::vector<RunFile>& runs, const std::string& name) {
  return std::all_of(runs.begin(), runs.end(), [&](const RunFile& run) {
    if (!run.find(name)) return false;
    const std::size_t count = values_of(run.column(name));
    return is_output(name) ? count >= std::min(output_rows_min, run.rows())
                           : 2 * count >= run.rows();
  });
}

/// A column that is constant from row to row in four of five rows is a setpoint or very coarse: it
/// acts like a signal, and neighbours do not predict it.
bool is_held(const std::vector<RunFile>& runs, const std::string& name) {
  std::size_t still = 0;
  std::size_t steps = 0;
  for (const RunFile& run : runs) {
    const std::vector<double>& values = run.column(name);
    for (std::size_t row = 1; row < values.size(); ++row, ++steps)
      if (values[row] == values[row - 1]) ++still;
  }
  return 5 * still >= 4 * steps;
}

/// Mean of the finite values; NaN without any.
double mean_of(const std::vector<double>& column, std::size_t begin, std::size_t end) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t row = begin; row < end; ++row) {
    if (!std::isfinite(column[row])) continue;
    sum += column[row];
    count += 1.0;
  }
  return count > 0 ? sum / count : not_a_number;
}

/// Replaces missing values by the previous one, at the start by the first.
void hold(Eigen::Ref<Eigen::VectorXd> column) {
  double held = not_a_number;
  for (Index row = 0; row < column.size() && !std::isfinite(held); ++row) held = column[row];
  if (!std::isfinite(held)) held = 0.0;
  for (double& value : column) value = held = std::isfinite(value) ? value : held;
}

}  // namespace

Recording make_recording(const std::vector<RunFile>& runs, Index rows_max) {
  Recording recording;
  for (const std::string& name : runs.front().columns) {
    if (name == "time_s" || !is_usable(runs, name)) continue;
    (is_temperature(name) && !is_held(runs, name) ? recording.temps
     : is_output(name)                            ? recording.outputs
                                                  : recording.signals)
        .push_back(name);
  }
  std::vector<std::size_t> strides;
  Index rows = 0;
  for (const RunFile& run : runs) {
    const std::size_t stride =
        (run.rows() + static_cast<std::size_t>(rows_max) - 1) / static_cast<std::size_t>(rows_max);
    recording.begins.push_back(rows);
    strides.push_back(std::max<std::size_t>(1, stride));
    rows += static_cast<Index>((run.rows() + strides.back() - 1) / strides.back());
  }
  recording.begins.push_back(rows);
  recording.time_s.resize(rows);
  const auto fill = [&](const std::string& name, Eigen::Ref<Eigen::VectorXd> column, bool held) {
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const std::vector<double>& from = runs[r].column(name);
      const Index begin = recording.begins[r];
      const Index count = recording.begins[r + 1] - begin;
      for (Index row = 0; row < count; ++row) {
        const std::size_t at = static_cast<std::size_t>(row) * strides[r];
        column[begin + row] = mean_of(from, at, std::min(at + strides[r], from.size()));
      }
      if (held) hold(column.segment(begin, count));
    }
  };
  const auto fill_all = [&](const std::vector<std::string>& names, Eigen::MatrixXd& matrix,
                            bool held) {
    matrix.resize(rows, static_cast<Index>(names.size()));
    for (std::size_t i = 0; i < names.size(); ++i)
      fill(names[i], matrix.col(static_cast<Index>(i)), held);
  };
  fill("time_s", recording.time_s, false);
  fill_all(recording.temps, recording.temps_K, true);
  fill_all(recording.signals, recording.values, true);
  fill_all(recording.outputs, recording.outputs_um, false);
  std::vector<std::string> names = recording.temps;
  names.emplace_back("time_s");
  recording.after_gap.setConstant(rows, static_cast<Index>(names.size()), false);
  for (std::size_t r = 0; r < runs.size(); ++r)
    for (std::size_t i = 0; i < names.size(); ++i)
      for (const std::size_t row : ends_of_gaps(runs[r], runs[r].column(names[i])))
        recording.after_gap(recording.begins[r] + static_cast<Index>(row / strides[r]),
                            static_cast<Index>(i)) = true;
  return recording;
}

Eigen::MatrixXd low_pass(const Recording& recording, const Eigen::MatrixXd& columns, double tau_s) {
  Eigen::MatrixXd passed = columns;
  for (std::size_t r = 0; r < recording.runs(); ++r) {
    for (Index row = recording.begins[r] + 1; row < recording.begins[r + 1]; ++row) {
      const double step_s = recording.time_s[row] - recording.time_s[row - 1];
      const double share = 1.0 - std::exp(-step_s / tau_s);
      passed.row(row) = (1.0 - share) * passed.row(row - 1) + share * columns.row(row);
    }
  }
  return passed;
}

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
