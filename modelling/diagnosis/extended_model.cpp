#include "modelling/diagnosis/extended_model.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp::diagnosis {
namespace {

constexpr double normal_95 = 1.96;
/// What a machine does besides is no noise of this search: with this factor 92 of 100 values that
/// were planted in measured machines lie within (1: 60 to 70). Jumps need none.
constexpr double wider_on_machines = 4.0;

double reach(const std::string& parameter, double sd) {
  const bool of_a_jump =
      parameter == "at_s" || parameter == "gain" || parameter == "step_K" || parameter == "step_um";
  return normal_95 * (of_a_jump ? 1.0 : wider_on_machines) * sd;
}

Interval around(double value, double reach) {
  return {value - reach, value + reach};
}

/// The first output that the explanation acts on.
std::size_t first_output(const Explanation& explanation) {
  std::size_t output = 0;
  while (explanation.gains[output].size() == 0) ++output;
  return output;
}

/// Gain number `index` of every output that it acts on.
Parameter gain_table(const Finding& finding, const MeasuredData& data, Eigen::Index index) {
  const Explanation& each = finding.explanation;
  Parameter parameter{each.hypothesis->gains[static_cast<std::size_t>(index)], {}, {}};
  for (std::size_t output = 0; output < each.gains.size(); ++output) {
    if (each.gains[output].size() == 0) continue;
    const std::string& name = data.model.outputs[output];
    parameter.values[name] = each.gains[output][index];
    parameter.ci95[name] =
        around(each.gains[output][index], reach(parameter.name, finding.gain_sd[output][index]));
  }
  return parameter;
}

/// p0 = -b / c of c p T + b T; over several outputs weighted by c^2.
Parameter pivot(const Finding& finding) {
  double above = 0.0;
  double below = 0.0;
  for (const Eigen::VectorXd& gains : finding.explanation.gains) {
    if (gains.size() == 0) continue;
    above -= gains[0] * gains[1];
    below += gains[0] * gains[0];
  }
  return {"p0_mm", {{"", below > 0 ? above / below : 0.0}}, {}};
}

Parameter amplitude(const Finding& finding) {
  const Eigen::VectorXd& waves = finding.explanation.gains[first_output(finding.explanation)];
  double sum = 0.0;
  for (Eigen::Index i = 0; i + 1 < waves.size(); i += 2) sum += std::hypot(waves[i], waves[i + 1]);
  return {"amplitude_um", {{"", 2.0 * sum / static_cast<double>(waves.size())}}, {}};
}

/// The one gain of a fault.
Parameter single_gain(const Finding& finding) {
  const Explanation& each = finding.explanation;
  const std::size_t output = first_output(each);
  const double gain = each.gains[output][0];
  const std::string& name = each.hypothesis->gains.front();
  const double wide = reach(name, finding.gain_sd[output][0]);
  if (each.hypothesis->cause != "sensor_loose")
    return {name, {{"", gain}}, {{"", around(gain, wide)}}};
  const double kept = 1.0 / (1.0 + gain);
  return {name, {{"", kept}}, {{"", around(kept, wide * kept * kept)}}};
}

}  // namespace

std::vector<Parameter> parameters_of(const Finding& finding, const MeasuredData& data) {
  const Explanation& each = finding.explanation;
  const Hypothesis& hypothesis = *each.hypothesis;
  std::vector<Parameter> all;
  for (std::size_t i = 0; i < hypothesis.shape.size(); ++i) {
    const double value = each.shape[i];
    Parameter parameter{hypothesis.shape[i].name, {{"", value}}, {}};
    const double wide = reach(parameter.name, finding.shape_sd[i]);
    if (hypothesis.shape[i].logarithmic && value > 0)
      parameter.ci95[""] = {value * std::exp(-wide), value * std::exp(wide)};
    else if (!hypothesis.shape[i].discrete)
      parameter.ci95[""] = around(value, wide);
    all.push_back(std::move(parameter));
  }
  if (hypothesis.cause == "position_dependence") {
    all.push_back(gain_table(finding, data, 0));
    all.push_back(pivot(finding));
  } else if (hypothesis.cause == "periodic_disturbance") {
    all.push_back(amplitude(finding));
  } else if (hypothesis.run) {
    all.push_back(single_gain(finding));
  } else if (hypothesis.form == Form::own_gains) {
    all.push_back(gain_table(finding, data, 0));
  }
  return all;
}

std::optional<TermSpec> term_of(const Finding& finding, const MeasuredData& data) {
  const Hypothesis& hypothesis = *finding.explanation.hypothesis;
  const TermKind* kind = find_term_kind(hypothesis.cause, hypothesis.subject);
  if (kind == nullptr) return std::nullopt;
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
