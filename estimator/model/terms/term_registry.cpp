#include <algorithm>

#include "estimator/checks.hpp"
#include "estimator/model/terms/term.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

constexpr const char* subject_key = "term.subject";

struct SubjectIndices {
  std::size_t first{0};
  std::size_t second{0};
};

/// @throws InvalidValue when the model has no such subject
SubjectIndices subject_indices(const TermSpec& spec, TermSubject subject, const ThermalModel& model,
                               const ModelColumns& of_model) {
  const std::vector<std::string>& temperatures = of_model.temperatures;
  const std::vector<std::string>& signals = of_model.signals;
  const SubjectColumns columns = subject_columns(spec.subject);
  switch (subject) {
    case TermSubject::signal:
      return {index_of(signals, columns.first, subject_key, "must be an operating signal")};
    case TermSubject::model_temperature:
      return {index_of(model.inputs, columns.first, subject_key, "must be an input of the model")};
    case TermSubject::output:
      return {
          index_of(model.outputs, columns.first, subject_key, "must be an output of the model")};
    case TermSubject::two_model_temperatures:
      return {
          index_of(model.inputs, columns.first, subject_key, "must be two inputs of the model"),
          index_of(model.inputs, columns.second, subject_key, "must be two inputs of the model")};
    case TermSubject::temperature_and_position: {
      const bool position_first = !is_temperature_name(columns.first);
      const std::string& place = position_first ? columns.second : columns.first;
      const std::string& position = position_first ? columns.first : columns.second;
      return {index_of(temperatures, place, subject_key, "must be a temperature and a position"),
              index_of(signals, position, subject_key, "must be a temperature and a position")};
    }
    case TermSubject::column_and_temperature: {
      const bool is_temperature = is_temperature_name(columns.first);
      return {index_of(is_temperature ? temperatures : signals, columns.first, subject_key,
                       "must be a temperature or a signal, then a temperature"),
              index_of(temperatures, columns.second, subject_key,
                       "must be a temperature or a signal, then a temperature")};
    }
    case TermSubject::several:
      return {};
    case TermSubject::other_temperature:
    case TermSubject::any_temperature:
      break;
  }
  return {index_of(temperatures, columns.first, subject_key, "must be a temperature")};
}

std::vector<std::size_t> bank_columns(const LagBankSpec& bank, const ModelColumns& of_model) {
  std::vector<std::size_t> columns;
  for (const std::string& subject : bank.subjects)
    columns.push_back(
        index_of(is_temperature_name(subject) ? of_model.temperatures : of_model.signals, subject,
                 "term.subjects", "must be a temperature or an operating signal"));
  return columns;
}

/// Shape (outputs, time constants, subjects); 0: not given.
/// @throws InvalidValue when a shape does not fit
std::vector<double> bank_gains(const LagBankSpec& bank, const ThermalModel& model) {
  const std::size_t subjects = bank.subjects.size();
  const std::size_t taus = bank.taus_s.size();
  const auto size = [](const auto& list) { return static_cast<double>(list.size()); };
  require(bank.powers.empty() || bank.powers.size() == subjects, "term.powers", size(bank.powers),
          "must have one value per subject");
  std::vector<double> gains(model.outputs.size() * subjects * taus, 0.0);
  for (const auto& [output, table] : bank.gain_um_per_unit) {
    const std::size_t begin =
        subjects * taus *
        index_of(model.outputs, output, "term.gain_um_per_unit", "is not an output of the model");
    require(table.size() == subjects, "term.gain_um_per_unit", size(table),
            "must have one row a subject");
    for (std::size_t i = 0; i < subjects; ++i) {
      require(table[i].size() == taus, "term.gain_um_per_unit", size(table[i]),
              "must have one value per time constant");
      for (std::size_t j = 0; j < taus; ++j) gains[begin + j * subjects + i] = table[i][j];
    }
  }
  return gains;
}

}  // namespace

const std::vector<TermRegistration>& term_registrations() {
  static const std::vector<TermRegistration> registrations = {
      thermal_lag_registration(),         missing_heat_source_registration(),
      missing_temperature_registration(), speed_growth_registration(),
      slow_sensor_registration(),         wrong_coefficient_registration(),
      nonlinear_expansion_registration(), position_dependence_registration(),
      output_hysteresis_registration(),   temperature_hysteresis_registration(),
      sensor_swap_registration(),         lag_bank_registration(),
      signal_hinge_registration(),        start_dependence_registration()};
  return registrations;
}

const std::vector<TermKind>& term_kinds() {
  static const std::vector<TermKind> kinds = [] {
    std::vector<TermKind> all;
    for (const TermRegistration& registration : term_registrations())
      all.push_back(registration.kind);
    return all;
  }();
  return kinds;
}

const TermKind* find_term_kind(std::string_view name, std::string_view subject) {
  const TermKind* best = nullptr;
  for (const TermKind& kind : term_kinds()) {
    if (kind.name != name) continue;
    const bool fits = (kind.subject == TermSubject::output) != is_temperature_name(subject);
    if (best == nullptr || fits) best = &kind;
  }
  return best;
}

std::unique_ptr<Term> make_term(const TermSpec& spec, const ThermalModel& model,
                                const ModelColumns& columns) {
  const TermKind* kind = find_term_kind(spec.kind, spec.subject);
  if (kind == nullptr) throw InvalidValue("term.kind", spec.kind, "is not a known kind of term");
  const TermRegistration& registration =
      term_registrations()[static_cast<std::size_t>(kind - term_kinds().data())];
  const auto shared = [&spec](std::string_view name) {
    const auto value = spec.shared.find(std::string(name));
    if (value == spec.shared.end())
      throw InvalidValue("term." + std::string(name), "(none)", "is missing");
    return value->second;
  };
  const auto per_output = [&spec, &model](std::string_view name) {
    std::vector<double> values(model.outputs.size(), 0.0);
    const auto table = spec.per_output.find(std::string(name));
    if (table == spec.per_output.end())
      throw InvalidValue("term." + std::string(name), "(none)", "is missing");
    for (const auto& [output, value] : table->second) {
      const auto place = std::find(model.outputs.begin(), model.outputs.end(), output);
      if (place == model.outputs.end())
        throw InvalidValue("term." + std::string(name), output, "is not an output of the model");
      values[static_cast<std::size_t>(place - model.outputs.begin())] = value;
    }
    return values;
  };
  const SubjectIndices subject = subject_indices(spec, kind->subject, model, columns);
  return registration.make({spec, subject.first, subject.second, per_output, shared,
                            bank_columns(spec.bank, columns), bank_gains(spec.bank, model)});
}

}  // namespace thermocomp
