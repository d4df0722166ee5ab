#include "modelling/diagnosis/data/measured_runs.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "config/runs/model_inputs.hpp"
#include "config/text/units.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/thermal_model.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis {

namespace {

constexpr double missing_share_max = 0.2;
/// A matrix that was fitted or calculated is right to a few per cent.
constexpr double coefficient_sd = 0.03;

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

double missing_share(const std::vector<double>& values) {
  const auto missing =
      std::count_if(values.begin(), values.end(), [](double x) { return !std::isfinite(x); });
  return static_cast<double>(missing) / static_cast<double>(values.size());
}

/// The column at the rows; missing values are held at the last one, at the start at the first.
Column taken(const std::vector<double>& values, const std::vector<std::size_t>& rows) {
  Column column(static_cast<Eigen::Index>(rows.size()));
  double last = first_value(values).value_or(0.0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (std::isfinite(values[rows[i]])) last = values[rows[i]];
    column[static_cast<Eigen::Index>(i)] = last;
  }
  return column;
}

Column rise_of(const Column& temps_degC, double reference_degC) {
  return temps_degC.array() - reference_degC;
}

void take_displacements(const RunFile& file, const std::vector<std::size_t>& rows,
                        const MeasuredData& data, MeasuredRun& run) {
  run.model_um = model_over(data.model, run, data);
  for (std::size_t output = 0; output < data.model.outputs.size(); ++output) {
    Column measured = Column::Constant(run.rows(), not_a_number);
    const auto index = file.find(data.model.outputs[output]);
    for (std::size_t i = 0; index && i < rows.size(); ++i)
      measured[static_cast<Eigen::Index>(i)] = file.values[*index][rows[i]];
    Eigen::Index start = 0;
    while (start < run.rows() && !std::isfinite(measured[start])) ++start;
    if (start < run.rows()) {
      measured.array() -= double(measured[start]);
      run.model_um[output].array() -= double(run.model_um[output][start]);
    }
    run.measured_um.push_back(std::move(measured));
  }
}

MeasuredRun measured_run(const RunFile& file, const std::string& name, const MeasuredData& data,
                         Purpose purpose) {
  const ModelInputs inputs = model_inputs(data.model, file);
  std::vector<std::size_t> rows = inputs.rows;
  rows.erase(std::lower_bound(rows.begin(), rows.end(), file.selected_end), rows.end());
  const auto refuse = [&](const std::string& key, const std::string& rule) {
    throw ConfigurationError({{file.name, 0, key, "(missing)", rule}});
  };
  MeasuredRun run;
  run.name = name;
  run.begin = std::lower_bound(rows.begin(), rows.end(), file.selected_begin) - rows.begin();
  if (run.begin == static_cast<Eigen::Index>(rows.size()))
    refuse("selection", "must have a row in which no input of the model is missing");
  run.time_s = taken(file.time_s(), rows);
  for (std::size_t i = 0; i < data.model.inputs.size(); ++i) {
    Column temps_degC = taken(*inputs.temperatures[i], rows);
    run.inputs_K.push_back(rise_of(temps_degC, inputs.reference_degC[i]));
    run.inputs_reference_degC.push_back(inputs.reference_degC[i]);
    if (purpose == Purpose::search) run.inputs_degC.push_back(std::move(temps_degC));
  }
  for (const std::string& other : data.others) {
    const std::vector<double>& column = file.column(other);
    Column temps_degC = taken(column, rows);
    run.others_reference_degC.push_back(first_value(column).value_or(0.0));
    run.others_K.push_back(rise_of(temps_degC, run.others_reference_degC.back()));
    if (purpose == Purpose::search) run.others_degC.push_back(std::move(temps_degC));
  }
  for (const std::string& signal : data.signals)
    run.signals.push_back(taken(file.column(signal), rows));
  if (purpose == Purpose::search) {
    for (const Column& rise_K : run.inputs_K)
      run.denoised_inputs_K.push_back(denoised(run.time_s, rise_K));
    for (const Column& rise_K : run.others_K)
      run.denoised_others_K.push_back(denoised(run.time_s, rise_K));
  }
  take_displacements(file, rows, data, run);
  const bool any = std::any_of(run.measured_um.begin(), run.measured_um.end(),
                               [](const auto& um) { return um.array().isFinite().any(); });
  if (!any) refuse(data.model.outputs.front(), "must have a measured value of an output");
  return run;
}

/// Null: there is none of this name.
const Column* find_column(const std::vector<std::string>& names, const std::vector<Column>& columns,
                          const std::string& name) {
  const auto at = std::find(names.begin(), names.end(), name);
  return at == names.end() ? nullptr : &columns[static_cast<std::size_t>(at - names.begin())];
}

}  // namespace

SharedColumns shared_columns(const ThermalModel& model, const std::vector<RunFile>& runs,
                             const std::vector<RunFile>& further) {
  SharedColumns columns;
  std::vector<std::string> always = model.temperature_columns();
  for (const std::string& name : model.signal_columns()) always.push_back(name);
  for (const std::string& name : runs.front().columns) {
    if (name == "time_s" || contains(model.inputs, name) || is_output(name)) continue;
    const auto has = [&name](const RunFile& run) {
      return run.find(name) && missing_share(run.column(name)) <= missing_share_max;
    };
    const bool everywhere = std::all_of(runs.begin(), runs.end(), has) &&
                            std::all_of(further.begin(), further.end(), has);
    if (!everywhere && !contains(always, name)) continue;
    (is_temperature(name) ? columns.others : columns.signals).push_back(name);
  }
  return columns;
}

std::vector<Column> model_over(const ThermalModel& model, const MeasuredRun& run,
                               const MeasuredData& data) {
  std::vector<const Column*> temperatures;
  std::vector<double> reference_degC;
  for (const std::string& name : model.temperature_columns()) {
    const Column* input = find_column(data.model.inputs, run.inputs_K, name);
    temperatures.push_back(input != nullptr ? input : find_column(data.others, run.others_K, name));
    reference_degC.push_back(data.reference_degC(run, name));
  }
  std::vector<const Column*> signals;
  for (const std::string& name : model.signal_columns())
    signals.push_back(find_column(data.signals, run.signals, name));
  const auto missing = [](const Column* column) { return column == nullptr; };
  if (std::any_of(temperatures.begin(), temperatures.end(), missing) ||
      std::any_of(signals.begin(), signals.end(), missing)) {
    throw ConfigurationError({{run.name, 0, "columns", "(missing)",
                               "a run must have every column of the model and its terms"}});
  }
  DisplacementModel displacement(model);
  // Of the absolute temperatures that the model sees, the rise is all but the reference.
  std::vector<double> temps_degC(temperatures.size());
  std::vector<double> signal_values(signals.size());
  std::vector<double> out(model.outputs.size());
  std::vector<Column> result(model.outputs.size(), Column(run.rows()));
  for (Eigen::Index row = 0; row < run.rows(); ++row) {
    for (std::size_t i = 0; i < temperatures.size(); ++i)
      temps_degC[i] = reference_degC[i] + (*temperatures[i])[row];
    for (std::size_t i = 0; i < signals.size(); ++i) signal_values[i] = (*signals[i])[row];
    displacement.step(time_of_row(run.time_s[row]), temps_degC, reference_degC, signal_values, out);
    for (std::size_t i = 0; i < out.size(); ++i) result[i][row] = out[i];
  }
  return result;
}

double MeasuredData::reference_degC(const MeasuredRun& run, const std::string& name) const {
  const auto input = std::find(model.inputs.begin(), model.inputs.end(), name);
  if (input != model.inputs.end())
    return run.inputs_reference_degC[static_cast<std::size_t>(input - model.inputs.begin())];
  const auto other = std::find(others.begin(), others.end(), name);
  return other == others.end()
             ? 0.0
             : run.others_reference_degC[static_cast<std::size_t>(other - others.begin())];
}

Column MeasuredData::coefficient(const MeasuredRun& run, std::size_t output,
                                 std::size_t input) const {
  if (model.guideways.empty())
    return Column::Constant(run.rows(), model.matrix_um_per_K[output][input]);
  ThermalModel alone = model;
  alone.terms.clear();
  MeasuredRun unit = run;
  for (Column& rise_K : unit.inputs_K) rise_K.setZero();
  unit.inputs_K[input].setOnes();
  return model_over(alone, unit, *this)[output];
}

MeasuredData measured_data(const ThermalModel& model, const std::vector<RunFile>& runs,
                           const std::vector<std::string>& names, const SharedColumns& columns,
                           Purpose purpose) {
  MeasuredData data{model, columns.others, columns.signals, {}, {}, coefficient_sd};
  data.runs.reserve(runs.size());
  for (std::size_t i = 0; i < runs.size(); ++i)
    data.runs.push_back(measured_run(runs[i], names[i], data, purpose));
  return data;
}

std::string room_among(const std::vector<std::string>& columns) {
  const auto room = std::find_if(columns.begin(), columns.end(), is_called_like_a_room);
  return room == columns.end() ? std::string() : *room;
}

const Column* room_degC(const MeasuredData& data, const MeasuredRun& run) {
  const Column* const other = find_column(data.others, run.others_degC, room_among(data.others));
  const std::vector<std::string>& inputs = data.model.inputs;
  return other != nullptr ? other : find_column(inputs, run.inputs_degC, room_among(inputs));
}

StackedRows stacked_rows(const MeasuredData& data) {
  StackedRows rows;
  Eigen::Index total = 0;
  for (const MeasuredRun& run : data.runs) {
    const Eigen::Index count = run.rows() - run.begin;
    rows.runs.push_back({total, total + count});
    total += count;
  }
  rows.time_s.resize(total);
  for (std::size_t i = 0; i < data.runs.size(); ++i)
    rows.time_s.segment(rows.runs[i].begin, rows.runs[i].end - rows.runs[i].begin) =
        data.runs[i].time_s.tail(rows.runs[i].end - rows.runs[i].begin);
  return rows;
}

namespace {

constexpr double alike_min = 0.98;

bool alike(const PlaceGroups& groups, const std::string& one, const std::string& other) {
  if (one == other) return true;
  const auto group = groups.find(one);
  return group != groups.end() &&
         std::find(group->second.begin(), group->second.end(), other) != group->second.end();
}

}  // namespace

PlaceGroups place_groups(const MeasuredData& data) {
  std::vector<std::string> names = data.model.inputs;
  names.insert(names.end(), data.others.begin(), data.others.end());
  Panel rises_K = stacked(data, stacked_rows(data), [&](const MeasuredRun& run) {
    Panel columns(run.rows(), std::ssize(names));
    Eigen::Index column = 0;
    for (const auto* of : {&run.inputs_K, &run.others_K})
      for (const Column& rise_K : *of) columns.col(column++) = rise_K;
    return columns;
  });
  rises_K.rowwise() -= rises_K.colwise().mean().eval();
  const Eigen::MatrixXd products = rises_K.transpose() * rises_K;
  PlaceGroups groups;
  for (Eigen::Index i = 0; i < products.rows(); ++i) {
    std::vector<std::string>& group = groups[names[static_cast<std::size_t>(i)]];
    for (Eigen::Index j = 0; j < products.rows(); ++j)
      if (i == j || products(i, j) > alike_min * std::sqrt(products(i, i) * products(j, j)))
        group.push_back(names[static_cast<std::size_t>(j)]);
  }
  return groups;
}

bool same_places(const PlaceGroups& groups, const std::string& subject, const std::string& other) {
  const SubjectColumns a = subject_columns(subject);
  const SubjectColumns b = subject_columns(other);
  if (a.second.empty() != b.second.empty()) return false;
  const bool in_order =
      alike(groups, a.first, b.first) && (a.second.empty() || alike(groups, a.second, b.second));
  return in_order || (!a.second.empty() && alike(groups, a.first, b.second) &&
                      alike(groups, a.second, b.first));
}

std::vector<std::string> group_of(const PlaceGroups& groups, const std::string& subject,
                                  const std::vector<std::string>& others) {
  std::vector<std::string> all;
  const auto add = [&all](const std::string& name) {
    if (!name.empty() && std::find(all.begin(), all.end(), name) == all.end()) all.push_back(name);
  };
  const auto add_places = [&add](const std::string& of) {
    const SubjectColumns places = subject_columns(of);
    add(places.first);
    add(places.second);
  };
  add_places(subject);
  for (const std::string& place : std::vector<std::string>(all)) {
    const auto group = groups.find(place);
    if (group == groups.end()) continue;
    for (const std::string& name : group->second) add(name);
  }
  for (const std::string& other : others) add_places(other);
  return all;
}

}  // namespace thermocomp::diagnosis
