#include "estimator/thermal_model.hpp"

#include <algorithm>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

void add_once(std::vector<std::string>& names, const std::string& name) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

/// Adds the temperature columns of the term, or its other columns.
void add_columns(std::vector<std::string>& names, const TermSpec& term, bool temperatures) {
  const TermKind* kind = find_term_kind(term.kind, term.subject);
  if (kind == nullptr || kind->subject == TermSubject::output) return;
  const bool mixed = kind->is_bank() || kind->subject == TermSubject::temperature_and_position ||
                     kind->subject == TermSubject::column_and_temperature;
  for (const std::string& column : term.subjects()) {
    const bool is_temperature =
        mixed ? is_temperature_name(column) : kind->subject != TermSubject::signal;
    if (is_temperature == temperatures) add_once(names, column);
  }
}

}  // namespace

void CovarianceGrowth::validate(std::size_t inputs) const {
  require(noise_K > 0 && noise_K <= 10, "covariance.noise_K", noise_K, "must be in (0, 10]");
  require(drift_time_s >= 0 && drift_time_s <= 1e9, "covariance.drift_time_s", drift_time_s,
          "must be in [0, 1e9]");
  require(scatter_time_s >= 0 && scatter_time_s <= 1e9, "covariance.scatter_time_s", scatter_time_s,
          "must be in [0, 1e9]");
  const auto check = [inputs](const std::vector<double>& factors, const char* key) {
    require(factors.empty() || factors.size() == inputs, key, static_cast<double>(factors.size()),
            "must have one value an input");
    for (const double factor : factors)
      require(factor >= 0 && factor <= 1e6, key, factor, "must be in [0, 1e6]");
  };
  check(drift_factor, "covariance.drift_factor");
  check(scatter_factor, "covariance.scatter_factor");
}

SubjectColumns subject_columns(std::string_view subject) {
  const auto bar = subject.find('|');
  if (bar == std::string_view::npos) return {std::string(subject), ""};
  return {std::string(subject.substr(0, bar)), std::string(subject.substr(bar + 1))};
}

bool TermSpec::is_bank() const {
  const TermKind* registered = find_term_kind(kind, subject);
  return registered != nullptr && registered->is_bank();
}

std::vector<std::string> TermSpec::subjects() const {
  if (is_bank()) return bank.subjects;
  const SubjectColumns columns = subject_columns(subject);
  std::vector<std::string> names;
  for (const std::string& column : {columns.first, columns.second})
    if (!column.empty()) names.push_back(column);
  return names;
}

bool is_temperature_name(std::string_view column) noexcept {
  return column.ends_with("_degC") || column.ends_with("_K");
}

std::vector<std::string> ThermalModel::temperature_columns() const {
  std::vector<std::string> columns = inputs;
  for (const TermSpec& term : terms) add_columns(columns, term, true);
  return columns;
}

std::vector<std::string> ThermalModel::signal_columns() const {
  std::vector<std::string> columns;
  for (const GuidewaySpec& guideway : guideways) add_once(columns, guideway.axis);
  for (const TermSpec& term : terms) add_columns(columns, term, false);
  return columns;
}

const DiameterSpec* diameter_of(const ThermalModel& model, std::string_view output) noexcept {
  for (const DiameterSpec& diameter : model.diameters)
    if (diameter.output == output) return &diameter;
  return nullptr;
}

std::string half_of(const DiameterSpec& diameter) {
  return std::string(diameter.sign < 0 ? "-half of " : "half of ") + diameter.output;
}

ThermalModel in_axis_units(ThermalModel model) {
  for (const DiameterSpec& diameter : model.diameters) {
    const double half = 0.5 * diameter.sign;
    const auto scale = [half](std::vector<double>& values) {
      for (double& value : values) value *= half;
    };
    for (std::size_t o = 0; o < model.outputs.size(); ++o)
      if (model.outputs[o] == diameter.output) scale(model.matrix_um_per_K[o]);
    for (GuidewaySpec& guideway : model.guideways)
      if (const auto rows = guideway.rows_um_per_K.find(diameter.output);
          rows != guideway.rows_um_per_K.end())
        for (std::vector<double>& row : rows->second) scale(row);
    for (TermSpec& term : model.terms) {
      for (auto& [name, by_output] : term.per_output)
        if (const auto value = by_output.find(diameter.output); value != by_output.end())
          value->second *= half;
      if (const auto rows = term.bank.gain_um_per_unit.find(diameter.output);
          rows != term.bank.gain_um_per_unit.end())
        for (std::vector<double>& row : rows->second) scale(row);
      if (const auto width = term.shared.find("width_um");
          term.subject == diameter.output && width != term.shared.end())
        width->second *= 0.5;
    }
    if (!model.made_from) continue;
    const auto found = model.made_from->outputs.find(diameter.output);
    if (found == model.made_from->outputs.end()) continue;
    MadeFrom::Output& left = found->second;
    for (double* const um :
         {&left.remainder_rms_um, &left.noise_um, &left.left_out_rms_um, &left.no_model_rms_um})
      *um *= 0.5;
  }
  model.diameters.clear();
  return model;
}

bool predict_the_same(const ThermalModel& a, const ThermalModel& b) {
  return a.inputs == b.inputs && a.outputs == b.outputs && a.reference_degC == b.reference_degC &&
         a.matrix_um_per_K == b.matrix_um_per_K && a.guideways == b.guideways &&
         a.terms == b.terms && a.diameters == b.diameters && a.made_from == b.made_from;
}

namespace {

bool has_other_than_zero(const std::vector<double>& gains) {
  return std::any_of(gains.begin(), gains.end(), [](double gain) { return gain != 0.0; });
}

bool has_other_than_zero(const std::map<std::string, std::vector<std::vector<double>>>& rows,
                         const std::string& output) {
  const auto found = rows.find(output);
  return found != rows.end() &&
         std::any_of(found->second.begin(), found->second.end(),
                     [](const std::vector<double>& row) { return has_other_than_zero(row); });
}

}  // namespace

bool has_gain(const ThermalModel& model, const std::string& output) {
  for (std::size_t i = 0; i < std::min(model.outputs.size(), model.matrix_um_per_K.size()); ++i)
    if (model.outputs[i] == output && has_other_than_zero(model.matrix_um_per_K[i])) return true;
  for (const GuidewaySpec& guideway : model.guideways)
    if (has_other_than_zero(guideway.rows_um_per_K, output)) return true;
  for (const TermSpec& term : model.terms) {
    if (has_other_than_zero(term.bank.gain_um_per_unit, output)) return true;
    for (const auto& [key, by_output] : term.per_output)
      if (const auto found = by_output.find(output);
          found != by_output.end() && found->second != 0.0)
        return true;
  }
  return false;
}

bool has_gain(const ThermalModel& model) {
  return std::any_of(model.outputs.begin(), model.outputs.end(),
                     [&](const std::string& output) { return has_gain(model, output); });
}

bool is_compared(const ThermalModel& model) {
  return model.made_from &&
         std::all_of(model.outputs.begin(), model.outputs.end(), [&](const std::string& output) {
           return model.made_from->outputs.contains(output);
         });
}

}  // namespace thermocomp
