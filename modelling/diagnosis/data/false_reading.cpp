#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis {
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

/// The input, and those that its reading goes to where channels are exchanged.
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

/// Those of the values that stand where `kept` says so.
template <class Value>
std::vector<Value> kept_of(const std::vector<Value>& values, const std::vector<bool>& kept) {
  std::vector<Value> some;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (kept[i]) some.push_back(values[i]);
  return some;
}

std::vector<bool> which_are(const std::vector<std::string>& columns, const Names& readings) {
  std::vector<bool> kept;
  kept.reserve(columns.size());
  for (const std::string& column : columns) kept.push_back(readings.contains(column));
  return kept;
}

void keep_subjects(LagBankSpec& bank, const Names& readings) {
  const std::vector<bool> kept = which_are(bank.subjects, readings);
  bank.subjects = kept_of(bank.subjects, kept);
  if (!bank.powers.empty()) bank.powers = kept_of(bank.powers, kept);
  for (auto& [output, gains] : bank.gain_um_per_unit) gains = kept_of(gains, kept);
}

/// The model without what the reading does not go into: less work a row.
ThermalModel part_of_reading(const ThermalModel& model, std::size_t input) {
  const Names readings = readings_beside(model, input);
  const std::vector<bool> kept = which_are(model.inputs, readings);
  ThermalModel part;
  part.inputs = kept_of(model.inputs, kept);
  part.outputs = model.outputs;
  for (const auto& row : model.matrix_um_per_K) part.matrix_um_per_K.push_back(kept_of(row, kept));
  for (GuidewaySpec guideway : model.guideways) {
    for (auto& [output, rows] : guideway.rows_um_per_K)
      for (auto& row : rows) row = kept_of(row, kept);
    part.guideways.push_back(std::move(guideway));
  }
  for (TermSpec term : model.terms) {
    if (!names_one_of(term, readings)) continue;
    if (term.kind == "lag_bank") keep_subjects(term.bank, readings);
    part.terms.push_back(std::move(term));
  }
  return part;
}

}  // namespace

static bool has_terms_of(const ThermalModel& model, std::size_t input) {
  return std::any_of(model.terms.begin(), model.terms.end(), [&](const TermSpec& term) {
    return names_one_of(term, {model.inputs[input]});
  });
}

Panel answer_to_errors(const MeasuredData& data, const MeasuredRun& run, std::size_t output,
                       std::size_t input, Panel errors_K) {
  if (!has_terms_of(data.model, input)) {
    errors_K.array().colwise() *= data.coefficient(run, output, input).array();
    return errors_K;
  }
  const ThermalModel part = part_of_reading(data.model, input);
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
  // Lags start as if their input had stood at its first value for long.
  return answer_to_errors(data, run, output, input, Panel::Ones(run.rows(), 1))(0, 0);
}

}  // namespace thermocomp::diagnosis
