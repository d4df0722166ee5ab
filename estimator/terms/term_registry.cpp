#include <algorithm>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"
#include "estimator/terms/term.hpp"

namespace thermocomp {
namespace {

std::size_t subject_index(const TermSpec& spec, const TermKind& kind, const ThermalModel& model) {
  if (kind.subject == TermSubject::signal)
    return index_of(model.signal_columns(), spec.subject, "term.subject",
                    "must be an operating signal");
  if (kind.subject == TermSubject::model_temperature)
    return index_of(model.inputs, spec.subject, "term.subject", "must be an input of the model");
  return index_of(model.temperature_columns(), spec.subject, "term.subject",
                  "must be a temperature");
}

}  // namespace

const std::vector<TermRegistration>& term_registrations() {
  static const std::vector<TermRegistration> registrations = {
      thermal_lag_registration(),
      missing_heat_source_registration(),
      missing_temperature_registration(),
      speed_growth_registration(),
  };
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

const TermKind* find_term_kind(std::string_view name) {
  const auto& kinds = term_kinds();
  const auto found = std::find_if(kinds.begin(), kinds.end(),
                                  [&](const TermKind& kind) { return kind.name == name; });
  return found == kinds.end() ? nullptr : &*found;
}

std::unique_ptr<Term> make_term(const TermSpec& spec, const ThermalModel& model) {
  const auto& all = term_registrations();
  const auto found = std::find_if(all.begin(), all.end(),
                                  [&](const auto& each) { return each.kind.name == spec.kind; });
  if (found == all.end()) throw InvalidValue("term.kind", spec.kind, "is not a known kind of term");
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
  return found->make({spec, subject_index(spec, found->kind, model), per_output, shared});
}

}  // namespace thermocomp
