#include "cli/model/prediction.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <optional>
#include <sstream>
#include <string_view>

#include "config/runs/model_inputs.hpp"
#include "config/text/units.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp::cli {

namespace {

using Column = std::vector<double>;
using Columns = std::vector<const Column*>;

// The model at every row of the file, NaN where an input is missing.
struct ModelRows {
  std::vector<Column> displacement_um;  ///< shape (outputs, rows)
  std::vector<Column> sd_um;            ///< likewise; empty without [made_from]
  Column outside;                       ///< by row
  FurthestRow furthest;
};

void take(const Columns& columns, std::size_t row, Column& out) {
  for (std::size_t i = 0; i < columns.size(); ++i) out[i] = (*columns[i])[row];
}

FurthestRow furthest_row(const ThermalModel& model, const RunFile& run, std::size_t row,
                         double distance, std::size_t column) {
  const MadeFrom& made_from = *model.made_from;
  const std::string& name = made_from.columns[column];
  return {run.time_s()[row],     distance, name, run.column(name)[row], made_from.low[column],
          made_from.high[column]};
}

ModelRows model_rows(const ThermalModel& model, const RunFile& run) {
  const ModelInputs inputs = model_inputs(model, run);
  DisplacementModel displacement_model(model);
  displacement_model.restart();
  Column temps_degC(inputs.temperatures.size());
  Column signal_values(inputs.signals.size());
  Column displacement_um(model.outputs.size());
  std::optional<ModelDomain> domain;
  if (model.made_from) domain.emplace(model);
  const std::vector<Column> empty(model.outputs.size(), Column(run.rows(), not_a_number));
  ModelRows rows{empty, domain ? empty : std::vector<Column>{}, {}, {}};
  if (domain) rows.outside.assign(run.rows(), not_a_number);
  for (const std::size_t row : inputs.rows) {
    take(inputs.temperatures, row, temps_degC);
    take(inputs.signals, row, signal_values);
    const nanoseconds now = time_of_row(run.time_s()[row]);
    displacement_model.step(now, temps_degC, inputs.reference_degC, signal_values, displacement_um);
    for (std::size_t i = 0; i < displacement_um.size(); ++i)
      rows.displacement_um[i][row] = displacement_um[i];
    if (!domain) continue;
    domain->step(now, temps_degC, inputs.reference_degC, signal_values);
    rows.outside[row] = domain->outside() ? 1.0 : 0.0;
    for (std::size_t i = 0; i < rows.sd_um.size(); ++i) rows.sd_um[i][row] = domain->sd_um(i);
    const double distance = domain->distance() / model.made_from->distance_max;
    if (row >= run.selected_begin && row < run.selected_end && distance > rows.furthest.distance)
      rows.furthest = furthest_row(model, run, row, distance, domain->furthest_column());
  }
  return rows;
}

// t0 of an output: the first row with a prediction and, if `measured` is given, a measured value.
std::size_t first_row(const Column& predicted, const Column* measured) {
  std::size_t row = 0;
  while (row < predicted.size() && !(std::isfinite(predicted[row]) &&
                                     (measured == nullptr || std::isfinite((*measured)[row])))) {
    ++row;
  }
  return row;
}

bool row_counts(const std::vector<Column>& predicted, const Columns& measured, std::size_t row) {
  if (!std::isfinite(predicted.front()[row])) return false;
  const auto has_value = [row](const Column* column) {
    return column != nullptr && std::isfinite((*column)[row]);
  };
  const auto is_there = [](const Column* column) { return column != nullptr; };
  return std::any_of(measured.begin(), measured.end(), has_value) ||
         std::none_of(measured.begin(), measured.end(), is_there);
}

void measure_residual(PredictedOutput& output) {
  double sum_of_squares = 0.0;
  double peak_um = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < output.predicted_um.size(); ++i) {
    const double residual_um = output.measured_um[i] - output.predicted_um[i];
    if (!std::isfinite(residual_um)) continue;
    sum_of_squares += residual_um * residual_um;
    peak_um = std::max(peak_um, std::abs(residual_um));
    ++count;
  }
  output.rms_um = count > 0 ? std::sqrt(sum_of_squares / static_cast<double>(count)) : not_a_number;
  output.peak_um = count > 0 ? peak_um : not_a_number;
}

}  // namespace

namespace {

/// @return nullptr if the selected rows have no measured value
const Column* measured_column(const RunFile& run, const std::string& output) {
  const auto index = run.find(output);
  if (!index) return nullptr;
  const Column& column = run.values[*index];
  const auto has_value = [](double value) { return std::isfinite(value); };
  const bool any =
      std::any_of(column.begin() + static_cast<std::ptrdiff_t>(run.selected_begin),
                  column.begin() + static_cast<std::ptrdiff_t>(run.selected_end), has_value);
  return any ? &column : nullptr;
}

Prediction predict_stretch(const ThermalModel& model, const RunFile& run) {
  const ModelRows all = model_rows(model, run);
  const std::vector<Column>& predicted = all.displacement_um;
  Columns measured;
  for (const std::string& output : model.outputs) {
    measured.push_back(measured_column(run, output));
  }

  Prediction result;
  result.furthest = all.furthest;
  std::vector<std::size_t> rows;
  for (std::size_t row = run.selected_begin; row < run.selected_end; ++row) {
    if (row_counts(predicted, measured, row)) rows.push_back(row);
  }
  for (const std::size_t row : rows) {
    result.time_s.push_back(run.time_s()[row]);
    if (!all.outside.empty()) result.outside.push_back(all.outside[row]);
  }
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    PredictedOutput output;
    output.name = model.outputs[i];
    output.measured_there = measured[i] != nullptr;
    const std::size_t start = first_row(predicted[i], measured[i]);
    for (const std::size_t row : rows) {
      const double offset_um = start < run.rows() ? predicted[i][start] : not_a_number;
      output.predicted_um.push_back(predicted[i][row] - offset_um);
      output.measured_um.push_back(output.measured_there && start < run.rows()
                                       ? (*measured[i])[row] - (*measured[i])[start]
                                       : not_a_number);
    }
    for (const std::size_t row : rows)
      if (!all.sd_um.empty()) output.sd_um.push_back(all.sd_um[i][row]);
    measure_residual(output);
    result.outputs.push_back(std::move(output));
  }
  return result;
}

void append(const Column& part, Column& whole) {
  whole.insert(whole.end(), part.begin(), part.end());
}

/// @pre of the same model
void append(const Prediction& part, Prediction& whole) {
  append(part.time_s, whole.time_s);
  append(part.outside, whole.outside);
  if (part.furthest.distance > whole.furthest.distance) whole.furthest = part.furthest;
  for (std::size_t i = 0; i < part.outputs.size(); ++i) {
    PredictedOutput& output = whole.outputs[i];
    append(part.outputs[i].predicted_um, output.predicted_um);
    append(part.outputs[i].measured_um, output.measured_um);
    append(part.outputs[i].sd_um, output.sd_um);
    output.measured_there = output.measured_there || part.outputs[i].measured_there;
    measure_residual(output);
  }
}

}  // namespace

Prediction predict(const ThermalModel& model, const RunFile& run) {
  if (run.references.empty()) return predict_stretch(model, run);
  const auto is_measured = [&model](const RunFile& each) {
    return std::any_of(model.outputs.begin(), model.outputs.end(), [&](const std::string& output) {
      return measured_column(each, output) != nullptr;
    });
  };
  std::vector<RunFile> parts = between_references(run);
  leave_out_empty_parts(model, parts);
  std::optional<Prediction> whole;
  for (const RunFile& part : parts) {
    if (is_measured(run) && !is_measured(part)) continue;
    const Prediction stretch = predict_stretch(model, part);
    if (whole)
      append(stretch, *whole);
    else
      whole = stretch;
  }
  return whole ? *whole : predict_stretch(model, run);
}

double outside_share(const Prediction& prediction) {
  double sum = 0.0;
  for (const double each : prediction.outside) sum += each;
  return prediction.outside.empty() ? 0.0 : sum / static_cast<double>(prediction.outside.size());
}

std::string furthest_text(const Prediction& prediction) {
  const FurthestRow& row = prediction.furthest;
  if (!(row.distance > 1.0)) return "";
  std::ostringstream text;
  text << std::setprecision(4) << "at " << std::lround(row.time_s) << " s the machine was "
       << std::setprecision(2) << row.distance << " times the limit away from the model's data, "
       << "mostly by " << std::setprecision(4) << row.column << ": " << row.value << " (recorded "
       << row.low << " to " << row.high << ")";
  if (row.value >= row.low && row.value <= row.high)
    text << ", in a new combination with other values or the past";
  return text.str();
}

RunFile as_run_file(const Prediction& prediction) {
  RunFile file;
  file.columns.emplace_back("time_s");
  file.values.push_back(prediction.time_s);
  for (const PredictedOutput& output : prediction.outputs) {
    const std::string unit(unit_of(output.name).suffix);
    const std::string stem = output.name.substr(0, output.name.size() - unit.size());
    const auto column_name = [&](const char* what) {
      std::string name = stem;
      return name.append("_").append(what).append(unit);
    };
    std::vector<double> residual_um;
    residual_um.reserve(output.predicted_um.size());
    for (std::size_t i = 0; i < output.predicted_um.size(); ++i) {
      residual_um.push_back(output.measured_um[i] - output.predicted_um[i]);
    }
    file.columns.push_back(column_name("predicted"));
    file.values.push_back(output.predicted_um);
    file.columns.push_back(column_name("measured"));
    file.values.push_back(output.measured_um);
    file.columns.push_back(column_name("residual"));
    file.values.push_back(std::move(residual_um));
    if (output.sd_um.empty()) continue;
    file.columns.push_back(column_name("sd"));
    file.values.push_back(output.sd_um);
  }
  if (!prediction.outside.empty()) {
    file.columns.emplace_back("outside");
    file.values.push_back(prediction.outside);
  }
  file.selected_end = prediction.time_s.size();
  return file;
}

}  // namespace thermocomp::cli
