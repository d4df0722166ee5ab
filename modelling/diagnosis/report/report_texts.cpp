#include "modelling/diagnosis/report/report_texts.hpp"

#include <algorithm>
#include <string_view>

#include "config/text/units.hpp"
#include "modelling/diagnosis/answer/gain_on_test.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/report/report_words.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Null: there is no such cause.
const CauseTexts* texts_of(const NamedFinding& finding) {
  const Cause* const cause = find_cause(finding.cause);
  if (cause == nullptr) return nullptr;
  const bool two_names = finding.subject.find('|') != std::string::npos;
  if (two_names && cause->texts_in_network) return &*cause->texts_in_network;
  if (cause->texts_without_unit && unit_of(finding.subject).suffix.empty())
    return &*cause->texts_without_unit;
  return &cause->texts;
}

/// The experiment that the first of them (causes/cause.hpp) asks for.
Experiment experiment_of(const std::string& cause, const std::string& other) {
  const auto of = [](const std::string& name) {
    const Cause* const known = find_cause(name);
    return known == nullptr ? Experiment::other_duty : known->experiment;
  };
  return std::min(of(cause), of(other));
}

}  // namespace

std::string title_of(const NamedFinding& finding) {
  const CauseTexts* of = texts_of(finding);
  std::string text(of == nullptr ? std::string_view(finding.cause) : of->title);
  return text.append(": ").append(finding.subject);
}

std::string title_of(const Alternative& other) {
  NamedFinding finding;
  finding.cause = other.cause;
  finding.subject = other.subject;
  return title_of(finding);
}

std::string sentence_of(const NamedFinding& finding) {
  const CauseTexts* of = texts_of(finding);
  std::string text = finding.subject;
  text += ": ";
  text += of == nullptr ? std::string_view(finding.cause) : of->says;
  if (finding.run) text.append(" (in ").append(*finding.run).append(")");
  for (const Parameter& parameter : finding.parameters)
    text.append("; ").append(parameter_words(finding.cause, parameter, finding.subject));
  for (const auto& [output, gain] : finding.test)
    text.append(gain.reduction > 0 ? "; knowing it takes the error of "
                                   : "; on the test runs it makes the error larger: that of ")
        .append(name_of_column(output))
        .append(gain.reduction > 0 ? "" : " goes")
        .append(" from ")
        .append(figure(gain.before_um))
        .append(" to ")
        .append(figure(gain.after_um));
  return text + ".";
}

std::string what_to_do(const NamedFinding& finding) {
  const CauseTexts* of = texts_of(finding);
  std::string usual = of == nullptr ? std::string() : std::string(of->to_do);
  if (!fails_on_test_runs(finding)) return usual;
  return "Do not use it yet: it holds for the training runs and not for the test runs, so the "
         "extended model goes without it. Record more runs. If they confirm it: " +
         usual;
}

std::string experiment_between(const Alternative& one, const Alternative& other) {
  const Experiment experiment = experiment_of(one.cause, other.cause);
  if (one.cause == other.cause && experiment != Experiment::of_a_network)
    return "Warm one of the two places alone (a heating pad for half an hour) and read both.";
  switch (experiment) {
    case Experiment::of_a_network:
      return "Warm up at one speed until nothing changes, then stop and record until nothing "
             "changes: the steady state tells films and joints, the way there capacities, the "
             "level sources.";
    case Experiment::another_run:
      return "Repeat the run with the same duty: a fault of one run does not come back.";
    case Experiment::standstill:
      return "Hold one constant speed for two hours, then stop and record two hours of standstill.";
    case Experiment::along_the_axis:
      return "Warm up, then measure at both ends and in the middle of the axis within ten minutes.";
    case Experiment::twice_as_slow:
      return "Repeat the same warm-up twice as slowly: a lag's loop closes, that of play does not.";
    case Experiment::up_and_down:
      return "Step the speed up and record until nothing moves, then step it down: only what has "
             "memory parts the two branches.";
    case Experiment::steady_levels:
      return "Hold three different temperatures of the place until nothing moves any more.";
    case Experiment::other_duty:
      break;
  }
  return "Repeat the run with another sequence of speeds and another room temperature.";
}

}  // namespace thermocomp::diagnosis
