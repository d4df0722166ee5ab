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
