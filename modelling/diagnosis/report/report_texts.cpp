#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "config/runs/model_inputs.hpp"
#include "config/text/units.hpp"
#include "modelling/diagnosis/answer/findings.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/report/diagnosis_report.hpp"

namespace thermocomp::diagnosis {

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

}  // namespace thermocomp::diagnosis
