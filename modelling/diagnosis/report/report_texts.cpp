#include "modelling/diagnosis/report/report_texts.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "modelling/diagnosis/gain_on_test.hpp"
#include "modelling/diagnosis/report/report_words.hpp"

namespace thermocomp::diagnosis {
namespace {

struct CauseTexts {
  std::string_view cause;
  std::string_view title;
  std::string_view says;  ///< continues "SUBJECT: "
  std::string_view to_do;
};

constexpr std::array<CauseTexts, 23> texts = {{
    {"thermal_lag", "Part of the structure follows late",
     "a part of the structure follows this temperature late",
     "Use the extended model; a sensor deeper in the slow part would make it unnecessary."},
    {"slow_sensor", "A sensor follows its place late",
     "the displacement leads the reading: the sensor follows its place late",
     "Look at how the sensor is mounted (paste, clamp, tape); until then use the extended model."},
    {"time_shift", "The recorders' clocks differ",
     "the displacement is logged at other times than the temperatures",
     "Set the clocks of both recorders, or correct the time column before anything is fitted."},
    {"missing_heat_source", "Heat that no sensor sees",
     "the machine goes on moving after this signal changes: heat that no sensor sees",
     "Use the extended model, or put a sensor where that heat enters."},
    {"speed_growth", "Growth with speed, not with heat",
     "the displacement jumps with the square of this signal",
     "Use the extended model; this part is not thermal and no sensor will show it."},
    {"missing_temperature", "A measured place that the model leaves out",
     "a measured place that the model ignores moves the machine",
     "Use the extended model, or take this place into the model when it is fitted again."},
    {"wrong_coefficient", "The effect of a place has another size",
     "the model moves by the wrong amount for each kelvin of this place",
     "Use the extended model; look at the support or material that the coefficient came from."},
    {"nonlinear_expansion", "The effect of a temperature is curved",
     "the effect of this temperature is curved",
     "Use the extended model; beyond the temperatures seen here the curve is not known."},
    {"position_dependence", "The effect grows along the axis",
     "the effect of this temperature grows along the axis",
     "Use the extended model, or give the model a guideway along this axis."},
    {"hysteresis", "Something sticks before it follows",
     "what moves sticks before it follows: a loop that does not depend on speed",
     "Look for a joint or a clamp that slips; the extended model carries it until then."},
    {"periodic_disturbance", "A cycle of its own",
     "a cycle of its own, which no temperature here explains",
     "Look for what switches with this period: a cooler, a pump, the room's ventilation."},
    {"displacement_step", "The datum jumped", "the datum of the displacement jumped once",
     "Do not fit to this run across the jump; look whether the probe was touched or set again."},
    {"displacement_drift", "The datum creeps",
     "the datum of the displacement creeps through the whole run",
     "Do not fit to this run; look at the probe, its holder and its amplifier's warm-up."},
    {"sensor_drift", "A reading creeps",
     "this reading creeps away from what its neighbours and the displacement say",
     "Replace or calibrate the sensor; leave the run out of any fit."},
    {"sensor_step", "A reading jumped", "this reading jumped and stayed",
     "Look at the connector and the amplifier's channel; leave the run out of any fit."},
    {"sensor_loose", "A sensor has come loose",
     "from a time on this sensor shows more of the room than of its place",
     "Fasten the sensor; leave the rest of the run out of any fit."},
    {"sensor_swap", "Two channels are exchanged", "these two channels are exchanged",
     "Exchange the two plugs or the two names in the configuration."},
    {"missing_heat", "Heat that the thermal model does not have",
     "this place warms with this signal: heat that the thermal model does not have",
     "Add a [[source]] with these figures, then look which motor, bearing or pump it is."},
    {"wrong_heat_source", "A source gives another heat",
     "this source gives another heat than the thermal model says",
     "Put the new heat_W into the thermal model; look at preload, load and speed of what warms."},
    {"wrong_film_coefficient", "Air or coolant takes another heat",
     "this place gives another heat to the air or the coolant than the "
     "thermal model says",
     "Put the new value into the thermal model; look for a cover, a fan or a blocked jacket."},
    {"wrong_conductance", "A joint conducts otherwise",
     "this joint conducts otherwise than the thermal model says",
     "Put the new value into the thermal model; look at pressure and flatness of the joint."},
    {"wrong_heat_capacity", "A place stores another heat",
     "this place stores another heat than the thermal model says",
     "Put the new value into the thermal model; look whether a mass was left out of it."},
    {"wrong_ambient", "The air here is not the room's",
     "the air around this is warmer or colder than the reading of the room",
     "Move the room's sensor to the air that the machine is in, or take the offset into account."},
}};

/// Of a thermal network: the subject is a signal and a place.
std::string_view key_of(const NamedFinding& finding) {
  const bool network = finding.subject.find('|') != std::string::npos;
  if (finding.cause == "missing_heat_source" && network) return "missing_heat";
  return finding.cause;
}

const CauseTexts* texts_of(std::string_view cause) {
  const auto at = std::find_if(texts.begin(), texts.end(),
                               [cause](const CauseTexts& each) { return each.cause == cause; });
  return at == texts.end() ? nullptr : &*at;
}

bool acts_at_once(std::string_view cause) {
  return cause == "speed_growth" || cause == "wrong_coefficient" ||
         cause == "nonlinear_expansion" || cause == "sensor_swap";
}

bool fault_of_one_run(std::string_view cause) {
  return cause.starts_with("displacement_") || cause == "sensor_drift" || cause == "sensor_step" ||
         cause == "sensor_loose";
}

bool of_a_network(std::string_view cause) {
  return cause == "wrong_heat_source" || cause == "wrong_film_coefficient" ||
         cause == "wrong_conductance" || cause == "wrong_heat_capacity" || cause == "wrong_ambient";
}

bool has_memory(std::string_view cause) {
  return cause == "thermal_lag" || cause == "slow_sensor" || cause == "time_shift" ||
         cause == "hysteresis";
}

}  // namespace

std::string title_of(const NamedFinding& finding) {
  const CauseTexts* of = texts_of(key_of(finding));
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
  const CauseTexts* of = texts_of(key_of(finding));
  std::string text = finding.subject;
  text += ": ";
  text += of == nullptr ? std::string_view(finding.cause) : of->says;
  if (finding.run) text.append(" (in ").append(*finding.run).append(")");
  for (const Parameter& parameter : finding.parameters)
    text.append("; ").append(parameter_words(parameter, finding.subject));
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
  const CauseTexts* of = texts_of(key_of(finding));
  std::string usual = of == nullptr ? std::string() : std::string(of->to_do);
  if (!fails_on_test_runs(finding)) return usual;
  return "Do not use it yet: it holds for the training runs and not for the test runs, so the "
         "extended model goes without it. Record more runs. If they confirm it: " +
         usual;
}

std::string experiment_for(const NamedFinding& finding, const Alternative& other) {
  const auto either = [&](const auto& test) { return test(finding.cause) || test(other.cause); };
  const auto named = [&](std::string_view cause) {
    return finding.cause == cause || other.cause == cause;
  };
  if (either(of_a_network))
    return "Warm up at one speed until nothing changes, then stop and record until nothing "
           "changes: "
           "the steady state tells films and joints, the way there capacities, the level sources.";
  if (finding.cause == other.cause)
    return "Warm one of the two places alone (a heating pad for half an hour) and read both.";
  if (either(fault_of_one_run))
    return "Repeat the run with the same duty: a fault of one run does not come back.";
  if (named("missing_heat_source") || named("speed_growth"))
    return "Hold one constant speed for two hours, then stop and record two hours of standstill.";
  if (named("position_dependence"))
    return "Warm up, then measure at both ends and in the middle of the axis within ten minutes.";
  if (named("hysteresis"))
    return "Repeat the same warm-up twice as slowly: a lag's loop closes, that of play does not.";
  if (either(has_memory))
    return "Step the speed up and record until nothing moves, then step it down: only what has "
           "memory parts the two branches.";
  if (either(acts_at_once))
    return "Hold three different temperatures of the place until nothing moves any more.";
  return "Repeat the run with another sequence of speeds and another room temperature.";
}

}  // namespace thermocomp::diagnosis
