#include "modelling/diagnosis/causes/cause.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "config/runs/robust.hpp"
#include "config/text/units.hpp"
#include "estimator/checks.hpp"

namespace thermocomp::diagnosis {

double shared_value(const std::vector<Parameter>& parameters, const std::string& name) {
  for (const Parameter& each : parameters)
    if (each.name == name) return each.values.at("");
  return 0.0;
}

Parameter gain_table(const FoundGains& found, Eigen::Index index) {
  Parameter parameter{found.names[static_cast<std::size_t>(index)], {}, {}};
  for (std::size_t output = 0; output < found.gains.size(); ++output) {
    if (found.gains[output].size() == 0) continue;
    const std::string& name = found.outputs[output];
    parameter.values[name] = found.gains[output][index];
    parameter.ci95[name] = found.ci95[output][static_cast<std::size_t>(index)];
  }
  return parameter;
}

std::size_t first_output(const FoundGains& found) {
  std::size_t output = 0;
  while (found.gains[output].size() == 0) ++output;
  return output;
}

std::size_t free_parameters(const Hypothesis& hypothesis) {
  const auto of_shape = std::count_if(hypothesis.shape.begin(), hypothesis.shape.end(),
                                      [](const ShapeParameter& each) { return !each.discrete; });
  return static_cast<std::size_t>(of_shape) + hypothesis.gains.size();
}

Shapes grid_of(const Hypothesis& hypothesis) {
  std::size_t points = 1;
  for (const ShapeParameter& parameter : hypothesis.shape) points *= parameter.grid.size();
  Shapes all;
  all.reserve(points);
  for (std::size_t number = 0; number < points; ++number) {
    Shape point(hypothesis.shape.size());
    std::size_t index = number;
    for (std::size_t i = point.size(); i-- > 0;) {
      const std::vector<double>& grid = hypothesis.shape[i].grid;
      point[i] = grid[index % grid.size()];
      index /= grid.size();
    }
    all.push_back(std::move(point));
  }
  return all;
}

std::vector<double> firsts_of(const Shapes& shapes) {
  std::vector<double> firsts;
  firsts.reserve(shapes.size());
  for (const Shape& shape : shapes) firsts.push_back(shape[0]);
  return firsts;
}

namespace {

/// Number of largest jumps whose times are tried in addition to a grid.
constexpr std::ptrdiff_t jumps_max = 12;

double median_step_s(const MeasuredData& data) {
  std::vector<double> steps;
  for (const MeasuredRun& run : data.runs)
    for (Eigen::Index row = run.begin + 1; row < run.rows(); ++row)
      steps.push_back(run.time_s[row] - run.time_s[row - 1]);
  return steps.empty() ? 1.0 : median(std::move(steps));
}

}  // namespace

Material::Material(const MeasuredData& data) : data_(data), step_s_(median_step_s(data)) {
  for (const MeasuredRun& run : data.runs)
    length_s_ = std::max(length_s_, run.time_s[run.rows() - 1] - run.time_s[run.begin]);
  const auto& inputs = data.model.inputs;
  settled_.setZero(std::ssize(data.model.outputs), std::ssize(inputs));
  settled_of_group_ = settled_;
  if (!data.model.guideways.empty()) return;
  for (std::size_t output = 0; output < data.model.outputs.size(); ++output)
    for (std::size_t input = 0; input < inputs.size(); ++input)
      settled_(static_cast<Eigen::Index>(output), static_cast<Eigen::Index>(input)) =
          diagnosis::settled_um_per_K(data, output, input);
  // A fit determines the sum of the coefficients of similar places, hardly each of them.
  const PlaceGroups groups = place_groups(data);
  for (std::size_t input = 0; input < inputs.size(); ++input)
    for (std::size_t other = 0; other < inputs.size(); ++other)
      if (same_places(groups, inputs[input], inputs[other]))
        settled_of_group_.col(static_cast<Eigen::Index>(input)) +=
            settled_.col(static_cast<Eigen::Index>(other));
}

const std::string& Material::name_of(const Subject& subject) const {
  switch (subject.kind) {
    case SubjectKind::input:
    case SubjectKind::input_in_run:
    case SubjectKind::other_temperature:
      return data_.temperatures[subject.index];
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
  if (subject.kind == SubjectKind::signal)
    return [index](const MeasuredRun& run) -> const Column& { return run.signals[index]; };
  THERMOCOMP_ENSURE(subject.kind == SubjectKind::input ||
                    subject.kind == SubjectKind::other_temperature);
  return [index](const MeasuredRun& run) -> const Column& { return run.denoised_K[index]; };
}

std::optional<Subject> Material::room() const {
  const std::optional<std::size_t> room = room_among(data_);
  if (!room) return {};
  const bool is_input = *room < data_.model.inputs.size();
  return Subject{is_input ? SubjectKind::input : SubjectKind::other_temperature, *room};
}

bool Material::moves_anywhere(const ColumnOf& of) const {
  return std::any_of(data_.runs.begin(), data_.runs.end(), [&](const MeasuredRun& run) {
    const auto values = of(run).tail(run.rows() - run.begin);
    return values.size() > 1 && values.maxCoeff() > values.minCoeff();
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
                                       std::size_t count, const Column& values) const {
  const MeasuredRun& of = data_.runs[run];
  const double begin_s = of.time_s[of.begin];
  const double span_s = of.time_s[of.rows() - 1] - begin_s;
  std::vector<double> onsets =
      linear_grid(begin_s + first * span_s, begin_s + last * span_s, count);
  std::vector<std::pair<double, double>> jumps;  // how far, when
  double before = not_a_number;
  for (Eigen::Index row = of.begin; row < of.rows(); ++row) {
    if (!std::isfinite(values[row])) continue;
    const double time_s = of.time_s[row];
    if (time_s >= onsets.front() && time_s <= onsets.back() && std::isfinite(before))
      jumps.emplace_back(-std::abs(values[row] - before), time_s);
    before = values[row];
  }
  const auto most = jumps.begin() + std::min(std::ssize(jumps), jumps_max);
  std::partial_sort(jumps.begin(), most, jumps.end());
  for (auto jump = jumps.begin(); jump != most; ++jump) onsets.push_back(jump->second);
  std::sort(onsets.begin(), onsets.end());
  onsets.erase(std::unique(onsets.begin(), onsets.end()), onsets.end());
  return onsets;
}

Panel since(const Column& time_s, const std::vector<double>& onsets_s) {
  Panel all(time_s.size(), std::ssize(onsets_s));
  for (Eigen::Index i = 0; i < all.cols(); ++i)
    all.col(i) = (time_s.array() >= onsets_s[static_cast<std::size_t>(i)]).cast<double>().matrix();
  return all;
}

namespace {

/// Least rows of a run in which faults of this run are sought.
constexpr Eigen::Index fault_rows_min = 24;

}  // namespace

const std::vector<Cause>& all_causes() {
  static const std::vector<Cause> all = [] {
    std::vector<Cause> joined;
    for (const auto family : {causes::of_structure, causes::of_heat, causes::of_datum,
                              causes::of_sensor, causes::of_network})
      for (Cause& each : family()) joined.push_back(std::move(each));
    return joined;
  }();
  return all;
}

const CauseParameter* find_parameter(const Cause& cause, std::string_view name) {
  const auto at = std::find_if(cause.parameters.begin(), cause.parameters.end(),
                               [&](const CauseParameter& each) { return each.name == name; });
  return at == cause.parameters.end() ? nullptr : &*at;
}

const Cause& cause_named(std::string_view name) {
  const std::vector<Cause>& all = all_causes();
  const auto at =
      std::find_if(all.begin(), all.end(), [&](const Cause& each) { return each.name == name; });
  THERMOCOMP_ENSURE(at != all.end());
  return *at;
}

std::vector<Hypothesis> hypotheses(const MeasuredData& data) {
  const auto material = std::make_shared<Material>(data);
  std::vector<Hypothesis> all;
  const auto add = [&](const Subject& subject) {
    for (const Cause& cause : all_causes()) {
      if (cause.hypotheses == nullptr) continue;
      for (Hypothesis& each : cause.hypotheses(*material, subject)) {
        each.cause = cause.name;
        // `effect` refers to the material, which `columns` keeps alive.
        each.columns = [material, effect = each.effect, run = each.run](const Shapes& shapes,
                                                                        std::size_t output) {
          return stacked(
              material->data(), [&](const MeasuredRun& of) { return effect(of, shapes, output); },
              run);
        };
        all.push_back(std::move(each));
      }
    }
  };
  const auto add_moving = [&](const Subject& subject) {
    if (material->moves_anywhere(material->values_of(subject))) add(subject);
  };
  const std::size_t inputs = data.model.inputs.size();
  for (std::size_t i = 0; i < data.temperatures.size(); ++i)
    add_moving({i < inputs ? SubjectKind::input : SubjectKind::other_temperature, i});
  for (std::size_t i = 0; i < data.signals.size(); ++i)
    if (kind_of(data.signals[i]) == QuantityKind::signal) add_moving({SubjectKind::signal, i});
  for (std::size_t i = 0; i < data.model.outputs.size(); ++i) add({SubjectKind::output, i});
  for (std::size_t run = 0; run < data.runs.size(); ++run) {
    const Block& rows = data.rows.runs[run];
    if (rows.end - rows.begin < fault_rows_min) continue;
    for (std::size_t i = 0; i < data.model.outputs.size(); ++i)
      add({SubjectKind::output_in_run, i, run});
    for (std::size_t i = 0; i < inputs; ++i) add({SubjectKind::input_in_run, i, run});
  }
  return all;
}

}  // namespace thermocomp::diagnosis
