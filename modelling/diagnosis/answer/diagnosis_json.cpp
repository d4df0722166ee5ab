#include <cmath>

#include <nlohmann/json.hpp>

#include "modelling/diagnosis/answer/answer.hpp"

namespace thermocomp::diagnosis {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json interval(const Interval& interval) {
  return Json::array({number(interval.low), number(interval.high)});
}

/// One shared value, or a table with one value per output.
template <class Value, class ToJson>
Json by_output(const std::map<std::string, Value>& values, ToJson to_json) {
  if (values.contains("")) return to_json(values.at(""));
  Json table = Json::object();
  for (const auto& [output, value] : values) table[output] = to_json(value);
  return table;
}

Json value_json(const Parameter& parameter) {
  return by_output(parameter.values, [&](double value) {
    return parameter.name == "power" ? Json(static_cast<int>(std::lround(value))) : number(value);
  });
}

/// "test_rms" as a key: test_rms_um.
std::string key_of(const char* what, const std::string& unit) {
  return std::string(what) + "_" + unit;
}

Json test_json(const std::map<std::string, TestGain>& gains) {
  Json test = Json::object();
  for (const auto& [output, gain] : gains)
    test[output] = {{"before", number(gain.before_um)},
                    {"after", number(gain.after_um)},
                    {"reduction", number(gain.reduction)},
                    {"ci95", interval(gain.ci95)}};
  return test;
}

Json remainder_json(const RemainderBank& remainder, const std::string& unit) {
  Json left_out = Json::object();
  for (const auto& [output, gain] : remainder.left_out)
    left_out[output] = {{"before", number(gain.before_um)}, {"after", number(gain.after_um)}};
  return {{"term", remainder.term.kind},
          {key_of("left_out_rms", unit), left_out},
          {key_of("test_rms", unit), test_json(remainder.test)}};
}

Json finding_json(const NamedFinding& finding, const std::string& unit) {
  Json parameters = Json::object();
  Json ci95 = Json::object();
  if (finding.run) parameters["run"] = *finding.run;
  for (const Parameter& parameter : finding.parameters) {
    parameters[parameter.name] = value_json(parameter);
    if (!parameter.ci95.empty()) ci95[parameter.name] = by_output(parameter.ci95, interval);
  }
  Json alternatives = Json::array();
  for (const Alternative& other : finding.alternatives)
    alternatives.push_back({{"cause", other.cause},
                            {"subject", other.subject},
                            {"relative_support", number(other.relative_support)}});
  const Json test = test_json(finding.test);
  return {{"cause", finding.cause},
          {"subject", finding.subject},
          {"probability", number(finding.probability)},
          {"family", finding.family},
          {"family_probability", number(finding.family_probability)},
          {"group", finding.group},
          {"outputs", finding.outputs},
          {"parameters", parameters},
          {"parameters_ci95", ci95},
          {"evidence", finding.evidence},
          {"alternatives", alternatives},
          {key_of("test_rms", unit), finding.test.empty() ? Json(nullptr) : test}};
}

/// @param in_full  with the inputs of the probability
Json candidate_json(const Candidate& of, const std::string& unit, bool in_full) {
  Json json = {{"cause", of.cause},
               {"subject", of.subject},
               {"probability", number(of.probability)},
               {"share_of_remainder", number(of.share_of_remainder)},
               {key_of("test_rms", unit), of.test.empty() ? Json(nullptr) : test_json(of.test)},
               {"would_decide", of.would_decide}};
  if (of.run) json["run"] = *of.run;
  if (!in_full) return json;
  for (const auto& [name, value] : of.figures) json[name] = number(value);
  return json;
}

Json weighed_json(const Diagnosis& diagnosis, bool in_full) {
  Json all = Json::array();
  for (const Candidate& each : diagnosis.weighed) {
    if (!in_full && all.size() >= candidates_reported) break;
    all.push_back(candidate_json(each, diagnosis.unit, in_full));
  }
  return all;
}

}  // namespace

std::string diagnosis_json(const Diagnosis& diagnosis, bool weighed) {
  const std::string& unit = diagnosis.unit;
  const std::string test_rms = key_of("test_rms", unit);
  const std::string test_peak = key_of("test_peak", unit);
  Json baseline = Json::object();
  Json extended = Json::object();
  Json unexplained = Json::object();
  Json headroom = Json::object();
  for (const auto& [output, figures] : diagnosis.outputs) {
    baseline[output] = {{key_of("train_rms", unit), number(figures.train_rms_um)},
                        {test_rms, number(figures.test_rms_um)},
                        {test_peak, number(figures.test_peak_um)}};
    extended[output] = {{test_rms, number(figures.extended_test_rms_um)},
                        {test_peak, number(figures.extended_test_peak_um)}};
    unexplained[output] = number(figures.unexplained_fraction);
    if (figures.headroom)
      headroom[output] = {{"noise", number(figures.headroom->noise)},
                          {"named", number(figures.headroom->named)},
                          {"predictable", number(figures.headroom->predictable)},
                          {"not_recorded", number(figures.headroom->not_recorded)}};
  }
  Json findings = Json::array();
  for (const NamedFinding& finding : diagnosis.findings)
    findings.push_back(finding_json(finding, unit));
  Json answer = {{"verdict", diagnosis.verdict},
                 {"baseline", baseline},
                 {"findings", findings},
                 {"extended", extended},
                 {"unexplained_fraction", unexplained}};
  if (!headroom.empty()) answer["headroom"] = headroom;
  if (diagnosis.remainder) answer["remainder"] = remainder_json(*diagnosis.remainder, unit);
  if (!diagnosis.families.empty()) answer["families"] = diagnosis.families;
  if (!diagnosis.weighed.empty()) answer["weighed"] = weighed_json(diagnosis, weighed);
  return answer.dump(2) + "\n";
}

}  // namespace thermocomp::diagnosis
