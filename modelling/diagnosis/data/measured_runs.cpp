#include "modelling/diagnosis/data/measured_runs.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include "config/runs/model_inputs.hpp"
#include "config/text/units.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::diagnosis {

Panel lagged(const Column& time_s, const Column& values, const std::vector<double>& taus_s) {
  const Eigen::Map<const Eigen::ArrayXd> taus(taus_s.data(), std::ssize(taus_s));
  Panel out(values.size(), taus.size());
  if (values.size() == 0) return out;
  out.row(0).setConstant(values[0]);
  Eigen::ArrayXd shares = Eigen::ArrayXd::Ones(taus.size());
  double step_s = -1.0;
  for (Eigen::Index row = 1; row < values.size(); ++row) {
    if (const double now_s = time_s[row] - time_s[row - 1]; now_s != step_s) {
      step_s = now_s;
      shares = (taus > 0).select(-(-step_s / taus.max(1e-300)).expm1(), 1.0);
    }
    out.row(row) =
        out.row(row - 1).array() + shares.transpose() * (values[row] - out.row(row - 1).array());
  }
  return out;
}

Column lagged(const Column& time_s, const Column& values, double tau_s) {
  return lagged(time_s, values, std::vector<double>{tau_s}).col(0);
}

Panel played_less_values(const Column& values, const std::vector<double>& widths) {
  const Eigen::ArrayXd half =
      0.5 * Eigen::Map<const Eigen::ArrayXd>(widths.data(), std::ssize(widths));
  Panel out(values.size(), half.size());
  Eigen::ArrayXd at = Eigen::ArrayXd::Constant(half.size(), values.size() > 0 ? values[0] : 0.0);
  for (Eigen::Index row = 0; row < values.size(); ++row) {
    at = at.max(values[row] - half).min(values[row] + half);
    out.row(row) = at - values[row];
  }
  return out;
}

Column shifted(const Column& time_s, const Column& values, double shift_s) {
  Column out(values.size());
  Eigen::Index row = 0;
  const Eigen::Index last = values.size() - 1;
  for (Eigen::Index i = 0; i <= last; ++i) {
    const double t = time_s[i] - shift_s;
    while (row > 0 && time_s[row] > t) --row;
    while (row < last && time_s[row + 1] <= t) ++row;
    if (row == last || t <= time_s[row]) {
      out[i] = values[row];
      continue;
    }
    const double share = (t - time_s[row]) / (time_s[row + 1] - time_s[row]);
    out[i] = values[row] + share * (values[row + 1] - values[row]);
  }
  return out;
}

Column smoothed(const Column& time_s, const Column& values, double tau_s) {
  Column smooth = lagged(time_s, values, tau_s);
  Column back_s = -time_s;
  back_s.reverseInPlace();
  smooth.reverseInPlace();
  smooth = lagged(back_s, smooth, tau_s);
  smooth.reverseInPlace();
  return smooth;
}

Column denoised(const Column& time_s, const Column& values) {
  const Eigen::Index last = values.size() - 1;
  Column best = values;
  if (last < 8) return best;
  // Without smoothing a row is predicted by the mean of its neighbours.
  double least = 0.0;
  for (Eigen::Index row = 1; row < last; ++row)
    least += std::pow(values[row] - 0.5 * (values[row - 1] + values[row + 1]), 2);
  const double step_s = (time_s[last] - time_s[0]) / static_cast<double>(last);
  for (const double rows : {1.0, 2.0, 4.0, 8.0}) {
    const Column smooth = smoothed(time_s, values, rows * step_s);
    // Weight of a value in its smoothed value.
    const double share = -std::expm1(-1.0 / rows);
    const double own = share / (2.0 - share);
    const double left = ((values - smooth) / (1.0 - own)).segment(1, last - 1).squaredNorm();
    if (!(left < least)) continue;
    least = left;
    best = smooth;
  }
  return best;
}

Column slope(const Column& time_s, const Column& values, double tau_s) {
  Column out = Column::Zero(values.size());
  if (values.size() < 2) return out;
  const Column smooth = smoothed(time_s, values, tau_s);
  const Eigen::Index last = values.size() - 1;
  for (Eigen::Index row = 0; row <= last; ++row) {
    const Eigen::Index before = std::max<Eigen::Index>(row - 1, 0);
    const Eigen::Index after = std::min(row + 1, last);
    out[row] = (smooth[after] - smooth[before]) / (time_s[after] - time_s[before]);
  }
  return out;
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

namespace {

/// Typical relative error of coefficients that were fitted or calculated.
constexpr double coefficient_sd = 0.03;

/// The column at the rows; a missing value is replaced by the last one, at the start by the first.
Column taken(const std::vector<double>& values, const std::vector<std::size_t>& rows) {
  Column column(static_cast<Eigen::Index>(rows.size()));
  double last = first_value(values).value_or(0.0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (std::isfinite(values[rows[i]])) last = values[rows[i]];
    column[static_cast<Eigen::Index>(i)] = last;
  }
  return column;
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

MeasuredRun measured_run(const RunFile& file, const MeasuredData& data) {
  const ModelInputs inputs = model_inputs(data.model, file);
  std::vector<std::size_t> rows = inputs.rows;
  rows.erase(std::lower_bound(rows.begin(), rows.end(), file.selected_end), rows.end());
  const auto refuse = [&](const std::string& key, const std::string& rule) {
    throw ConfigurationError({{file.name, 0, key, "(missing)", rule}});
  };
  MeasuredRun run;
  run.name = file.argument;
  run.begin = std::lower_bound(rows.begin(), rows.end(), file.selected_begin) - rows.begin();
  if (run.begin == static_cast<Eigen::Index>(rows.size()))
    refuse("selection", "must have a row in which no input of the model is missing");
  run.time_s = taken(file.time_s(), rows);
  for (std::size_t i = 0; i < data.temperatures.size(); ++i) {
    const std::vector<double>& temps_degC = file.column(data.temperatures[i]);
    run.reference_degC.push_back(i < data.model.inputs.size()
                                     ? inputs.reference_degC[i]
                                     : first_value(temps_degC).value_or(0.0));
    run.temps_K.push_back(taken(temps_degC, rows).array() - run.reference_degC[i]);
    run.denoised_K.push_back(denoised(run.time_s, run.temps_K[i]));
  }
  for (const std::string& signal : data.signals)
    run.signals.push_back(taken(file.column(signal), rows));
  take_displacements(file, rows, data, run);
  const bool any = std::any_of(run.measured_um.begin(), run.measured_um.end(),
                               [](const auto& um) { return um.array().isFinite().any(); });
  if (!any) refuse(data.model.outputs.front(), "must have a measured value of an output");
  return run;
}

std::size_t place_among(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

}  // namespace

SharedColumns shared_columns(const ThermalModel& model, const std::vector<RunFile>& runs,
                             const std::vector<RunFile>& further) {
  SharedColumns columns{model.inputs, {}};
  std::vector<std::string> always = model.temperature_columns();
  for (const std::string& name : model.signal_columns()) always.push_back(name);
  for (const std::string& name : runs.front().columns) {
    if (name == "time_s" || place_among(model.inputs, name) < model.inputs.size() ||
        is_output(name))
      continue;
    const auto has = [&name](const RunFile& run) {
      return run.find(name) && is_mostly_known(run.column(name));
    };
    const bool everywhere = std::all_of(runs.begin(), runs.end(), has) &&
                            std::all_of(further.begin(), further.end(), has);
    if (!everywhere && place_among(always, name) == always.size()) continue;
    (is_temperature(name) ? columns.temperatures : columns.signals).push_back(name);
  }
  return columns;
}

std::vector<Column> model_over(const ThermalModel& model, const MeasuredRun& run,
                               const MeasuredData& data) {
  const auto refuse_missing = [&](std::size_t place, const std::vector<Column>& columns) {
    if (place >= columns.size())
      throw ConfigurationError({{run.name, 0, "columns", "(missing)",
                                 "a run must have every column of the model and its terms"}});
  };
  std::vector<const Column*> temperatures;
  std::vector<double> reference_degC;
  for (const std::string& name : model.temperature_columns()) {
    const std::size_t place = data.place_of(name);
    refuse_missing(place, run.temps_K);
    temperatures.push_back(&run.temps_K[place]);
    reference_degC.push_back(run.reference_degC[place]);
  }
  std::vector<const Column*> signals;
  for (const std::string& name : model.signal_columns()) {
    const std::size_t place = place_among(data.signals, name);
    refuse_missing(place, run.signals);
    signals.push_back(&run.signals[place]);
  }
  DisplacementModel displacement(model);
  // The model takes absolute temperatures.
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

std::size_t MeasuredData::place_of(const std::string& temperature) const {
  return place_among(temperatures, temperature);
}

void MeasuredData::add(MeasuredRun run) {
  const Eigen::Index begin = rows.time_s.size();
  const Eigen::Index count = run.rows() - run.begin;
  rows.runs.push_back({begin, begin + count});
  rows.time_s.conservativeResize(begin + count);
  rows.time_s.tail(count) = run.time_s.tail(count);
  run.number = runs.size();
  runs.push_back(std::move(run));
}

Column MeasuredData::coefficient(const MeasuredRun& run, std::size_t output,
                                 std::size_t input) const {
  if (model.guideways.empty())
    return Column::Constant(run.rows(), model.matrix_um_per_K[output][input]);
  ThermalModel alone = model;
  alone.terms.clear();
  MeasuredRun unit = run;
  for (Column& rise_K : unit.temps_K) rise_K.setZero();
  unit.temps_K[input].setOnes();
  return model_over(alone, unit, *this)[output];
}

MeasuredData measured_data(const ThermalModel& model, const std::vector<RunFile>& runs,
                           const SharedColumns& columns) {
  MeasuredData data{model, columns.temperatures, columns.signals, {}, {}, {}, coefficient_sd};
  for (const RunFile& run : runs) data.add(measured_run(run, data));
  return data;
}

std::optional<std::size_t> room_among(const MeasuredData& data) {
  const auto begin = data.temperatures.begin();
  const auto other = begin + std::ssize(data.model.inputs);
  auto room = std::find_if(other, data.temperatures.end(), is_called_like_a_room);
  if (room == data.temperatures.end()) {
    room = std::find_if(begin, other, is_called_like_a_room);
    if (room == other) return std::nullopt;
  }
  return static_cast<std::size_t>(room - begin);
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
  const std::vector<std::string>& names = data.temperatures;
  Panel rises_K = stacked(data, [&](const MeasuredRun& run) {
    Panel columns(run.rows(), std::ssize(names));
    for (Eigen::Index i = 0; i < columns.cols(); ++i)
      columns.col(i) = run.temps_K[static_cast<std::size_t>(i)];
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

namespace {

using Names = std::set<std::string>;

std::vector<std::string> subjects_of(const TermSpec& term) {
  if (term.kind == "lag_bank") return term.bank.subjects;
  const SubjectColumns columns = subject_columns(term.subject);
  if (columns.second.empty()) return {columns.first};
  return {columns.first, columns.second};
}

bool names_one_of(const TermSpec& term, const Names& readings) {
  const std::vector<std::string> subjects = subjects_of(term);
  return std::any_of(subjects.begin(), subjects.end(),
                     [&](const std::string& subject) { return readings.contains(subject); });
}

/// The input and those that use its reading through exchanged channels.
Names readings_beside(const ThermalModel& model, std::size_t input) {
  Names readings = {model.inputs[input]};
  for (std::size_t known = 0; known < readings.size();) {
    known = readings.size();
    for (const TermSpec& term : model.terms) {
      if (term.kind != "sensor_swap" || !names_one_of(term, readings)) continue;
      for (std::string& name : subjects_of(term)) readings.insert(std::move(name));
    }
  }
  return readings;
}

/// Removes subjects that are not among the readings.
void narrow(LagBankSpec& bank, const Names& readings) {
  for (std::size_t i = bank.subjects.size(); i-- > 0;) {
    if (readings.contains(bank.subjects[i])) continue;
    const auto at = static_cast<std::ptrdiff_t>(i);
    bank.subjects.erase(bank.subjects.begin() + at);
    if (!bank.powers.empty()) bank.powers.erase(bank.powers.begin() + at);
    for (auto& [output, gains] : bank.gain_um_per_unit) gains.erase(gains.begin() + at);
  }
}

/// The model without terms and bank subjects that do not use the reading; without a play of an
/// output, too.
ThermalModel part_of_reading(const ThermalModel& model, std::size_t input) {
  const Names readings = readings_beside(model, input);
  ThermalModel part = model;
  std::erase_if(part.terms, [&](const TermSpec& term) { return !names_one_of(term, readings); });
  for (TermSpec& term : part.terms)
    if (term.kind == "lag_bank") narrow(term.bank, readings);
  return part;
}

}  // namespace

Panel answer_to_errors(const MeasuredData& data, const MeasuredRun& run, std::size_t output,
                       std::size_t input, Panel errors_K) {
  const ThermalModel part = part_of_reading(data.model, input);
  if (part.terms.empty()) {
    errors_K.array().colwise() *= data.coefficient(run, output, input).array();
    return errors_K;
  }
  const Column right_um = model_over(part, run, data)[output];
  MeasuredRun wrong = run;
  for (Eigen::Index i = 0; i < errors_K.cols(); ++i) {
    wrong.temps_K[input] = run.temps_K[input] + errors_K.col(i);
    errors_K.col(i) = model_over(part, wrong, data)[output] - right_um;
  }
  return errors_K;
}

double settled_um_per_K(const MeasuredData& data, std::size_t output, std::size_t input) {
  const MeasuredRun& run = data.runs.front();
  // Lags start in the steady state of their first value.
  return answer_to_errors(data, run, output, input, Panel::Ones(run.rows(), 1))(0, 0);
}

}  // namespace thermocomp::diagnosis
