#include "estimator/thermal_model.hpp"

#include <algorithm>

namespace thermocomp {
namespace {

void add_once(std::vector<std::string>& names, const std::string& name) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

}  // namespace

std::vector<std::string> ThermalModel::temperature_columns() const {
  std::vector<std::string> columns = inputs;
  for (const TermSpec& term : terms) {
    const TermKind* kind = find_term_kind(term.kind);
    if (kind != nullptr && kind->subject != TermSubject::signal) add_once(columns, term.subject);
  }
  return columns;
}

std::vector<std::string> ThermalModel::signal_columns() const {
  std::vector<std::string> columns;
  for (const GuidewaySpec& guideway : guideways) add_once(columns, guideway.axis);
  for (const TermSpec& term : terms) {
    const TermKind* kind = find_term_kind(term.kind);
    if (kind != nullptr && kind->subject == TermSubject::signal) add_once(columns, term.subject);
  }
  return columns;
}

const std::vector<TermKind>& term_kinds() {
  constexpr double gain_max = 1e6;
  constexpr double tau_s_max = 1e6;
  static const std::vector<TermKind> kinds = {
      {"thermal_lag", TermSubject::model_temperature,
       {{"tau_s", false, 1e-3, tau_s_max}, {"gain_um_per_K", true, -gain_max, gain_max}}},
      {"missing_heat_source", TermSubject::signal,
       {{"tau_s", false, 1e-3, tau_s_max},
        {"power", false, 1, 2, true},
        {"gain_um_per_unit", true, -gain_max, gain_max}}},
      {"speed_growth", TermSubject::signal, {{"gain_um_per_unit2", true, -gain_max, gain_max}}},
      {"missing_temperature", TermSubject::other_temperature,
       {{"gain_um_per_K", true, -gain_max, gain_max}, {"tau_s", false, 0, tau_s_max}}},
  };
  return kinds;
}

const TermKind* find_term_kind(std::string_view name) {
  const auto& kinds = term_kinds();
  const auto found = std::find_if(kinds.begin(), kinds.end(),
                                  [&](const TermKind& kind) { return kind.name == name; });
  return found == kinds.end() ? nullptr : &*found;
}

}  // namespace thermocomp
