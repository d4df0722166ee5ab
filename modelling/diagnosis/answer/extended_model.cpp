#include "modelling/diagnosis/answer/extended_model.hpp"

#include <utility>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
std::vector<Parameter> parameters_of(const Finding& finding, const MeasuredData& data) {
  const Explanation& each = finding.explanation;
  const Hypothesis& hypothesis = *each.hypothesis;
  const Cause& cause = cause_named(hypothesis.cause);
  std::vector<Parameter> all;
  for (std::size_t i = 0; i < hypothesis.shape.size(); ++i) {
    Parameter parameter{hypothesis.shape[i].name, {{"", each.shape[i]}}, {}};
    if (!hypothesis.shape[i].discrete) parameter.ci95[""] = finding.shape_ci[i];
    all.push_back(std::move(parameter));
  }
  if (cause.gains == nullptr) return all;
  for (Parameter& parameter :
       cause.gains({hypothesis.gains, data.model.outputs, each.gains, finding.gains_ci}))
    all.push_back(std::move(parameter));
  return all;
}

std::optional<TermSpec> term_of(const Finding& finding, const MeasuredData& data) {
  const Hypothesis& hypothesis = *finding.explanation.hypothesis;
  const std::string& kind = cause_named(hypothesis.cause).term;
  if (kind.empty()) return std::nullopt;
  TermSpec term{kind, hypothesis.subject, {}, {}};
  for (const Parameter& parameter : parameters_of(finding, data)) {
    if (parameter.values.contains(""))
      term.shared[parameter.name] = parameter.values.at("");
    else
      term.per_output[parameter.name] = parameter.values;
  }
  return term;
}

}  // namespace thermocomp::diagnosis
