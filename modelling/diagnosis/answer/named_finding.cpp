#include "modelling/diagnosis/answer/named_finding.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/rank/posterior.hpp"

namespace thermocomp::diagnosis {

namespace {

constexpr double support_shown_min = 0.001;
constexpr std::size_t alternatives_max = 4;

std::vector<Alternative> alternatives_of(const Finding& finding) {
  std::vector<Alternative> all;
  for (const Explanation& other : finding.alternatives) {
    const double support = other.probability / finding.explanation.probability;
    if (!(support > support_shown_min) || all.size() >= alternatives_max) break;
    const Hypothesis& of = *other.hypothesis;
    const bool known = std::any_of(all.begin(), all.end(), [&](const Alternative& each) {
      return each.cause == of.cause && each.subject == of.subject;
    });
    if (!known) all.push_back({of.cause, of.subject, std::min(1.0, support)});
  }
  return all;
}

std::string evidence_text(const Explanation& of) {
  char text[160];
  std::snprintf(text, sizeof text,
                "takes %.0f %% of the RMS of %s training rows; ln L exceeds that of no cause by "
                "%.0f, its parameters paid for",
                100.0 * share_of_remainder(of), of.hypothesis->run ? "the fitted" : "left-out",
                of.score);
  return text;
}

}  // namespace

double share_of_remainder(const Explanation& explanation) {
  return 1.0 - std::exp(-explanation.left_out_of_best);
}

NamedFinding named_finding(const Finding& finding, const MeasuredData& data,
                           std::vector<Parameter> parameters) {
  const Explanation& each = finding.explanation;
  NamedFinding name{each.hypothesis->cause, each.hypothesis->subject, {}, {}, {}, {}, {}, {}};
  for (std::size_t output = 0; output < each.gains.size(); ++output)
    if (each.gains[output].size() > 0) name.outputs.push_back(data.model.outputs[output]);
  name.parameters = std::move(parameters);
  if (each.hypothesis->run) name.run = data.runs[*each.hypothesis->run].name;
  name.evidence = evidence_text(each);
  name.alternatives = alternatives_of(finding);
  name.family = family_of(name.cause);
  name.probability = finding.probability;
  name.family_probability = finding.family_probability;
  name.group = finding.group;
  return name;
}

std::string verdict_of(const SearchResult& result) {
  if (!result.findings.empty()) return "effect";
  return result.unexplained ? "unexplained" : "none";
}

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
  if (hypothesis.gains.empty()) return all;
  const FoundGains found{hypothesis.gains, data.model.outputs, each.gains, finding.gains_ci};
  if (cause.gains != nullptr) {
    for (Parameter& parameter : cause.gains(found)) all.push_back(std::move(parameter));
    return all;
  }
  Parameter gains = gain_table(found, 0);
  if (hypothesis.output || hypothesis.form == Form::shared_gain) {
    const std::string& output = data.model.outputs[first_output(found)];
    gains = {gains.name, {{"", gains.values.at(output)}}, {{"", gains.ci95.at(output)}}};
  }
  all.push_back(std::move(gains));
  return all;
}

std::optional<TermSpec> term_of(const Finding& finding, const MeasuredData& data) {
  const Hypothesis& hypothesis = *finding.explanation.hypothesis;
  if (find_term_kind(hypothesis.cause, hypothesis.subject) == nullptr) return std::nullopt;
  TermSpec term{hypothesis.cause, hypothesis.subject, {}, {}};
  for (const Parameter& parameter : parameters_of(finding, data)) {
    if (parameter.values.contains(""))
      term.shared[parameter.name] = parameter.values.at("");
    else
      term.per_output[parameter.name] = parameter.values;
  }
  return term;
}

}  // namespace thermocomp::diagnosis
