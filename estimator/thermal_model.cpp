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

}  // namespace thermocomp
