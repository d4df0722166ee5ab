#include "modelling/diagnosis/answer/named_finding.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "modelling/diagnosis/evidence/posterior.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Rows are correlated: 2 ln L overstates what a difference is worth. Support is told as if one row
/// in ten were a new one.
constexpr double independent_share = 0.1;
constexpr double support_shown_min = 0.001;
constexpr std::size_t alternatives_max = 4;
constexpr double probability_floor = 0.5;

/// Of another explanation beside the one that was chosen: by their probabilities where they have
/// any.
double support_of(const Explanation& other, const Explanation& chosen) {
  if (chosen.probability > 0 && other.probability > 0)
    return other.probability / chosen.probability;
  return std::exp(-0.5 * independent_share * (chosen.score - other.score));
}

std::vector<Alternative> alternatives_of(const Finding& finding) {
  std::vector<Alternative> all;
  for (const Explanation& other : finding.alternatives) {
    const double support = support_of(other, finding.explanation);
    if (support < support_shown_min || all.size() >= alternatives_max) break;
    const Hypothesis& of = *other.hypothesis;
    const bool known = std::any_of(all.begin(), all.end(), [&](const Alternative& each) {
      return each.cause == of.cause && each.subject == of.subject;
    });
    if (!known) all.push_back({of.cause, of.subject, std::min(1.0, support)});
  }
  return all;
}

std::string evidence_text(const Finding& finding) {
  char text[160];
  std::snprintf(
      text, sizeof text,
      "takes %.0f %% of the RMS of %s training rows; 2 ln L gains %.0f beyond the price of "
      "its parameters",
      100.0 * finding.explanation.left_out_gain,
      finding.explanation.hypothesis->run ? "the fitted" : "left-out", finding.explanation.score);
  return text;
}

}  // namespace

NamedFinding named_finding(const Finding& finding, const MeasuredData& data,
                           std::vector<Parameter> parameters) {
  const Explanation& each = finding.explanation;
  NamedFinding name{each.hypothesis->cause, each.hypothesis->subject, {}, {}, {}, {}, {}, {}};
  for (std::size_t output = 0; output < each.gains.size(); ++output)
    if (each.gains[output].size() > 0) name.outputs.push_back(data.model.outputs[output]);
  name.parameters = std::move(parameters);
  if (each.hypothesis->run) name.run = data.runs[*each.hypothesis->run].name;
  name.evidence = evidence_text(finding);
  name.alternatives = alternatives_of(finding);
  name.family = family_of(name.cause);
  // What passed gates in place of probabilities is likelier than not.
  name.probability = std::max(probability_floor, each.probability);
  name.family_probability = std::max(name.probability, each.family_probability);
  return name;
}

std::string verdict_of(const SearchResult& result) {
  if (!result.findings.empty()) return "effect";
  return result.unexplained ? "unexplained" : "none";
}

}  // namespace thermocomp::diagnosis
