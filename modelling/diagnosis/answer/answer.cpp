#include "modelling/diagnosis/answer/answer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

#include <nlohmann/json.hpp>

#include "config/runs/model_inputs.hpp"
#include "config/text/units.hpp"

namespace thermocomp::diagnosis {

bool fails_on_test_runs(const NamedFinding& finding) {
  return !finding.test.empty() &&
         std::none_of(finding.test.begin(), finding.test.end(),
                      [](const auto& of_output) { return of_output.second.reduction > 0; });
}

namespace {

constexpr std::string_view thousand_of = "rpm";

std::string words_of(double value, double scale, bool is_duration) {
  return is_duration ? duration(value) : figure(scale * value);
}

/// " (47 min to 59 min)"; empty if both ends are printed like the value.
std::string interval_words(const Interval& interval, double value, double scale, bool is_duration) {
  const std::string low = words_of(interval.low, scale, is_duration);
  const std::string high = words_of(interval.high, scale, is_duration);
  const std::string text = words_of(value, scale, is_duration);
  if (low == text && high == text) return "";
  return " (" + low + " to " + high + ")";
}

/// Unit as a divisor; of a signal without a unit its name.
std::string unit_of_column(const std::string& column) {
  const std::string_view suffix = unit_of(column).suffix;
  if (suffix == "_mm_per_min") return "(mm/min)";
  return suffix.empty() ? column : std::string(suffix.substr(1));
}

}  // namespace

std::string figure(double value) {
  if (!std::isfinite(value)) return "-";
  if (value == 0.0) return "0";
  const int power = static_cast<int>(std::floor(std::log10(std::abs(value)) + 1e-9));
  const bool begins_with_1 = std::abs(value) < 2.0 * std::pow(10.0, power);
  const int digits = begins_with_1 ? 3 : 2;
  const double unit = std::pow(10.0, power - digits + 1);
  char text[40];
  std::snprintf(text, sizeof text, "%.*f", std::max(0, digits - 1 - power),
                std::round(value / unit) * unit);
  return text;
}

std::string duration(double seconds) {
  const double size = std::abs(seconds);
  if (!(size >= 120.0)) return figure(seconds) + " s";
  if (size < 7200.0) return figure(seconds / 60.0) + " min";
  return figure(seconds / 3600.0) + " h";
}

std::string name_of_column(const std::string& column) {
  const std::size_t last = column.rfind('_');
  return last == std::string::npos || last == 0 ? column : column.substr(0, last);
}

std::string parameter_words(const std::string& cause, const Parameter& parameter,
                            const std::string& subject) {
  if (parameter.name == "power") {
    const bool square = parameter.values.contains("") && parameter.values.at("") > 1.5;
    return square ? "with the square of the signal" : "in proportion to the signal";
  }
  const CauseParameter* const known = find_parameter(cause_named(cause), parameter.name);
  const std::string description(known == nullptr ? std::string_view(parameter.name)
                                                 : known->description);
  std::string unit(known == nullptr || known->unit == "1" ? std::string_view() : known->unit);
  double scale = 1.0;
  if (const std::size_t at = unit.find('?'); at != std::string::npos) {
    const std::string of_subject = unit_of_column(subject);
    const bool squared = unit.ends_with("^2");
    const bool thousand = of_subject == thousand_of;
    unit.replace(at, 1, thousand ? "(1000 " + of_subject + ")" : of_subject);
    if (thousand) scale = squared ? 1e6 : 1e3;
  }
  const bool is_duration = unit == "s";
  if (unit.starts_with("um")) unit.replace(0, 1, "µ");
  std::string text = description;
  bool first = true;
  for (const auto& [output, value] : parameter.values) {
    text += first ? " " : ", ";
    first = false;
    text += words_of(value, scale, is_duration);
    const auto ci = parameter.ci95.find(output);
    if (ci != parameter.ci95.end()) text += interval_words(ci->second, value, scale, is_duration);
    if (!is_duration && !unit.empty()) text.append(" ").append(unit);
    if (!output.empty()) text.append(" in ").append(name_of_column(output));
  }
  return text;
}

namespace {

const CauseTexts& texts_of(const std::string& cause_name, const std::string& subject) {
  const Cause& cause = cause_named(cause_name);
  const bool two_names = subject.find('|') != std::string::npos;
  if (two_names && cause.texts_in_network) return *cause.texts_in_network;
  if (cause.texts_without_unit && unit_of(subject).suffix.empty()) return *cause.texts_without_unit;
  return cause.texts;
}

/// In the order of Experiment.
constexpr std::array<std::string_view, 8> experiment_texts{
    "Warm up at one speed until nothing changes, then stop and record until nothing changes: the "
    "steady state tells films and joints, the way there capacities, the level sources.",
    "Repeat the run with the same duty: a fault of one run does not come back.",
    "Hold one constant speed for two hours, then stop and record two hours of standstill.",
    "Warm up, then measure at both ends and in the middle of the axis within ten minutes.",
    "Repeat the same warm-up twice as slowly: a lag's loop closes, that of play does not.",
    "Step the speed up and record until nothing moves, then step it down: only what has memory "
    "parts the two branches.",
    "Hold three different temperatures of the place until nothing moves any more.",
    "Repeat the run with another sequence of speeds and another room temperature."};

/// Separates two subjects: one changes, the other does not.
std::string one_alone(const std::string& one, const std::string& other) {
  const bool can_warm = is_temperature(one) && !is_called_like_a_room(one);
  const std::string& warmed = can_warm ? one : other;
  const std::string& stays = can_warm ? other : one;
  if (!is_temperature(warmed) || is_called_like_a_room(warmed))
    return "Let " + one + " change for an hour while " + other +
           " stays, then the other way round.";
  return "Warm the place of " + warmed + " alone (a heating pad for half an hour) while " + stays +
         " stays, and read both.";
}

}  // namespace

std::string title_of(const std::string& cause, const std::string& subject) {
  return std::string(texts_of(cause, subject).title).append(": ").append(subject);
}

std::string sentence_of(const NamedFinding& finding) {
  std::string text = finding.subject + ": ";
  text += texts_of(finding.cause, finding.subject).description;
  if (finding.run) text.append(" (in ").append(*finding.run).append(")");
  for (const Parameter& parameter : finding.parameters)
    text.append("; ").append(parameter_words(finding.cause, parameter, finding.subject));
  const char* before = ". Error on the test runs without and with it: ";
  for (const auto& [output, gain] : finding.test) {
    text.append(before).append(name_of_column(output)).append(" ").append(figure(gain.before_um));
    text.append(" and ").append(figure(gain.after_um));
    if (!(gain.reduction > 0)) text += " (larger)";
    before = "; ";
  }
  return text + ".";
}

std::string what_to_do(const NamedFinding& finding) {
  std::string usual(texts_of(finding.cause, finding.subject).to_do);
  if (!fails_on_test_runs(finding)) return usual;
  return "Do not use it yet: it holds for the training runs and not for the test runs, so the "
         "extended model goes without it. Record more runs. If they confirm it: " +
         usual;
}

std::string experiment_between(const Alternative& one, const Alternative& other) {
  const Experiment experiment =
      std::min(cause_named(one.cause).experiment, cause_named(other.cause).experiment);
  if (one.cause == other.cause && one.subject != other.subject &&
      experiment != Experiment::of_a_network)
    return one_alone(one.subject, other.subject);
  return std::string(experiment_texts.at(static_cast<std::size_t>(experiment)));
}

namespace {

void print_test_gain(const std::string& output, const TestGain& gain) {
  std::printf("  %s, test rows: RMS %.3f -> %.3f (%.0f %%, 95 %%: %.0f to %.0f)\n", output.c_str(),
              gain.before_um, gain.after_um, 100 * gain.reduction, 100 * gain.ci95.low,
              100 * gain.ci95.high);
}

void print(const RemainderBank& remainder) {
  std::printf("predictable without a name: carried by a bank of lags, last term of the model\n");
  if (remainder.changes_coefficients)
    std::printf(
        "  the model was fitted to these rows: its coefficients change with the bank, and both are "
        "judged fitted anew\n");
  for (const auto& [output, gain] : remainder.left_out)
    std::printf("  %s, rows left out: RMS %.3f -> %.3f\n", output.c_str(), gain.before_um,
                gain.after_um);
  for (const auto& [output, gain] : remainder.test) {
    print_test_gain(output, gain);
    if (!(gain.reduction > 0))
      std::printf("  worse on the test runs: this output goes without it\n");
  }
}

}  // namespace

bool all_fail_on_test_runs(const Diagnosis& diagnosis) {
  return !diagnosis.findings.empty() &&
         std::all_of(diagnosis.findings.begin(), diagnosis.findings.end(), fails_on_test_runs);
}

void print(const Diagnosis& diagnosis) {
  for (const std::string& warning : diagnosis.warnings)
    std::printf("warning: %s\n", warning.c_str());
  std::printf("verdict: %s%s\n", diagnosis.verdict.c_str(),
              all_fail_on_test_runs(diagnosis) ? ", but the test runs contradict it" : "");
  for (const NamedFinding& finding : diagnosis.findings) {
    std::printf("%s of %s", finding.cause.c_str(), finding.subject.c_str());
    if (finding.run) std::printf(" in %s", finding.run->c_str());
    std::printf(": %s\n", finding.evidence.c_str());
    if (std::isfinite(finding.probability))
      std::printf("  probability %.2f; %s, %.2f\n", finding.probability, finding.family.c_str(),
                  finding.family_probability);
    if (finding.group.size() > 1) {
      std::printf("  cannot be told apart:");
      for (const std::string& place : finding.group) std::printf(" %s", place.c_str());
      std::printf("\n");
    }
    for (const Parameter& parameter : finding.parameters)
      for (const auto& [output, value] : parameter.values)
        std::printf("  %s%s%s = %.6g\n", parameter.name.c_str(), output.empty() ? "" : " ",
                    output.c_str(), value);
    for (const auto& [output, gain] : finding.test) print_test_gain(output, gain);
    if (fails_on_test_runs(finding))
      std::printf("  worse on the test runs: left out of the extended model\n");
    for (const Alternative& other : finding.alternatives)
      std::printf("  or: %s of %s (support %.2g)\n", other.cause.c_str(), other.subject.c_str(),
                  other.relative_support);
  }
  if (diagnosis.remainder) print(*diagnosis.remainder);
  if (diagnosis.findings.empty())
    for (const auto& [family, probability] : diagnosis.families)
      std::printf("weighed: %s, probability %.2f\n", family.c_str(), probability);
  for (const auto& [output, figures] : diagnosis.outputs)
    if (figures.headroom)
      std::printf(
          "%s: left by the model: noise %.0f %%, named %.0f %%, predictable %.0f %%, not "
          "in this recording %.0f %%\n",
          output.c_str(), 100 * figures.headroom->noise, 100 * figures.headroom->named,
          100 * figures.headroom->predictable, 100 * figures.headroom->not_recorded);
  for (const auto& [output, figures] : diagnosis.outputs)
    std::printf("%s: RMS train %.3f, test %.3f, extended %.3f; without a name %.0f %%\n",
                output.c_str(), figures.train_rms_um, figures.test_rms_um,
                figures.extended_test_rms_um, 100 * figures.unexplained_fraction);
}

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
  Json answer = {{"verdict", diagnosis.verdict}, {"warnings", diagnosis.warnings},
                 {"baseline", baseline},         {"findings", findings},
                 {"extended", extended},         {"unexplained_fraction", unexplained}};
  if (!headroom.empty()) answer["headroom"] = headroom;
  if (diagnosis.remainder) answer["remainder"] = remainder_json(*diagnosis.remainder, unit);
  if (!diagnosis.families.empty()) answer["families"] = diagnosis.families;
  if (!diagnosis.weighed.empty()) answer["weighed"] = weighed_json(diagnosis, weighed);
  return answer.dump(2) + "\n";
}

}  // namespace thermocomp::diagnosis
