#include "modelling/diagnosis/hypothesis/material.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"
#include "modelling/diagnosis/data/false_reading.hpp"

namespace thermocomp::diagnosis {
namespace {

double median_step_s(const MeasuredData& data) {
  std::vector<double> steps;
  for (const MeasuredRun& run : data.runs)
    for (Eigen::Index row = run.begin + 1; row < run.rows(); ++row)
      steps.push_back(run.time_s[row] - run.time_s[row - 1]);
  if (steps.empty()) return 1.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

bool moves(const Column& column) {
  return column.size() > 1 && column.maxCoeff() > column.minCoeff();
}

}  // namespace

Material::Material(const MeasuredData& data, const StackedRows& rows)
    : data_(data), rows_(rows), groups_(place_groups(data)), step_s_(median_step_s(data)) {
  for (const MeasuredRun& run : data.runs)
    length_s_ = std::max(length_s_, run.time_s[run.rows() - 1] - run.time_s[run.begin]);
  settled_um_per_K_.setZero(std::ssize(data.model.outputs), std::ssize(data.model.inputs));
  if (!data.model.guideways.empty()) return;
  for (std::size_t output = 0; output < data.model.outputs.size(); ++output)
    for (std::size_t input = 0; input < data.model.inputs.size(); ++input)
      settled_um_per_K_(static_cast<Eigen::Index>(output), static_cast<Eigen::Index>(input)) =
          diagnosis::settled_um_per_K(data, output, input);
}

const std::string& Material::name_of(const Subject& subject) const {
  switch (subject.kind) {
    case SubjectKind::input:
    case SubjectKind::input_in_run:
      return data_.model.inputs[subject.index];
    case SubjectKind::other_temperature:
      return data_.others[subject.index];
    case SubjectKind::signal:
      return data_.signals[subject.index];
    case SubjectKind::output:
    case SubjectKind::output_in_run:
      break;
  }
  return data_.model.outputs[subject.index];
}

ColumnOf Material::values_of(const Subject& subject) const {
  const std::size_t index = subject.index;
  if (subject.kind == SubjectKind::input)
    return [index](const MeasuredRun& run) -> const Column& { return run.calm_inputs_K[index]; };
  if (subject.kind == SubjectKind::other_temperature)
    return [index](const MeasuredRun& run) -> const Column& { return run.calm_others_K[index]; };
  THERMOCOMP_ENSURE(subject.kind == SubjectKind::signal);
  return [index](const MeasuredRun& run) -> const Column& { return run.signals[index]; };
}

bool Material::moves_anywhere(const ColumnOf& of) const {
  return std::any_of(data_.runs.begin(), data_.runs.end(), [&](const MeasuredRun& run) {
    return moves(of(run).tail(run.rows() - run.begin));
  });
}

double Material::range(const ColumnOf& of) const {
  double range = 0.0;
  for (const MeasuredRun& run : data_.runs)
    range = std::max(range, of(run).maxCoeff() - of(run).minCoeff());
  return range;
}

std::vector<double> Material::lag_times_s(double low_s, double high_s, std::size_t count) const {
  const double low = std::max(low_s, 0.5 * step_s_);
  const double high = std::max(2.0 * low, std::min(high_s, 0.5 * length_s_));
  return logarithmic_grid(low, high, count);
}

std::vector<double> Material::onsets_s(std::size_t run, double first, double last,
                                       std::size_t count) const {
  const MeasuredRun& of = data_.runs[run];
  const double begin_s = of.time_s[of.begin];
  const double span_s = of.time_s[of.rows() - 1] - begin_s;
  return linear_grid(begin_s + first * span_s, begin_s + last * span_s, count);
}

void Material::write_since(std::size_t run, const std::vector<double>& onsets_s,
                           const Column& whole, PanelPart into) const {
  const Block& block = rows_.runs[run];
  into.setZero();
  for (std::size_t i = 0; i < onsets_s.size(); ++i) {
    const double* const time_s = rows_.time_s.data();
    const Eigen::Index first =
        std::lower_bound(time_s + block.begin, time_s + block.end, onsets_s[i]) - time_s;
    into.col(static_cast<Eigen::Index>(i)).segment(first, block.end - first) =
        whole.tail(block.end - first);
  }
}

std::vector<double> logarithmic_grid(double low, double high, std::size_t count) {
  std::vector<double> grid;
  for (std::size_t i = 0; i < count; ++i)
    grid.push_back(low *
                   std::pow(high / low, static_cast<double>(i) / static_cast<double>(count - 1)));
  return grid;
}

std::vector<double> linear_grid(double low, double high, std::size_t count) {
  std::vector<double> grid;
  for (std::size_t i = 0; i < count; ++i)
    grid.push_back(low + (high - low) * static_cast<double>(i) / static_cast<double>(count - 1));
  return grid;
}

}  // namespace thermocomp::diagnosis
