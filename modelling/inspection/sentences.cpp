#include <algorithm>
#include <cmath>
#include <cstdio>

#include "modelling/inspection/checks.hpp"

namespace thermocomp::inspection {
namespace {

/// Two digits that count.
std::string two_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", value);
  return std::abs(value) >= 100 ? std::to_string(std::lround(value)) : text;
}

/// "3 h 20 min" after the run's first row.
std::string moment(double time_s, const RunFile& run) {
  const auto minutes = std::lround((time_s - run.time_s().front()) / 60.0);
  if (minutes < 1) return "the start";
  if (minutes < 60) return std::to_string(minutes) + " min";
  const std::string hours = std::to_string(minutes / 60) + " h";
  return minutes % 60 == 0 ? hours : hours + " " + std::to_string(minutes % 60) + " min";
}

std::string duration(double seconds) {
  if (std::abs(seconds) < 120) return two_digits(seconds) + " s";
  if (std::abs(seconds) < 7200) return two_digits(seconds / 60) + " min";
  return two_digits(seconds / 3600) + " h";
}

std::string sentence(const Finding& finding, const RunFile& run) {
  const std::string at = moment(finding.at_s, run);
  const std::string size = two_digits(std::abs(finding.size)) + " " + finding.unit;
  const std::string& kind = finding.kind;
  const std::string count = std::to_string(finding.times_s.size());
  if (kind == "spikes")
    return finding.column + " leaps away and back (" + count + "), by up to " + size +
           ": look at its plug and its shield; these values should be left out.";
  if (kind == "outliers")
    return finding.column + " has values apart from their neighbours (" + count + "), by up to " +
           size + ": a probing that went wrong, or chips; they should be left out.";
  if (kind == "sensor_step")
    return finding.column + " jumps by " + size + (finding.size > 0 ? " upwards" : " downwards") +
           " after " + at +
           " and stays there, while its neighbours do not: the sensor moved, or its "
           "contact or channel changed.";
  if (kind == "sensor_drift")
    return finding.column + " creeps " + (finding.size > 0 ? "up" : "down") + " by " + size +
           " from " + at +
           " to the end of the run, while its neighbours do not: the sensor ages or "
           "comes off.";
  if (kind == "sensor_loose")
    return finding.column + " follows its neighbours with only " +
           std::to_string(std::lround(100 * finding.size)) + " % of its motion from " + at +
           " on: the sensor has come loose and feels the air.";
  if (kind == "sensor_swap")
    return finding.column + " and " + finding.other +
           " agree with the other runs only when they are "
           "exchanged: check the plugs; they were " +
           size + " apart.";
  if (kind == "stuck")
    return finding.column + " stays at one value from " + at + " to " +
           moment(finding.until_s, run) + " while other places moved by " + size +
           ": the channel hangs, or it is a set value and no "
           "reading.";
  if (kind == "coarse")
    return finding.column + " is recorded in steps of " + size +
           ": nothing finer can be learnt from it; have it written with more digits.";
  if (kind == "copy")
    return finding.column + " is the same as " + finding.other +
           " throughout: one channel was recorded twice.";
  if (kind == "displacement_step")
    return finding.column + " jumps by " + size + " after " + at +
           " without a change of temperature or operation: the probe, the work or the zero was "
           "moved.";
  if (kind == "gap")
    return (finding.column.empty()  ? "Nothing was recorded"
            : finding.other.empty() ? finding.column + " has no value"
                                    : finding.column + ", " + finding.other + " have no value") +
           " for " + duration(finding.size) + " after " + at + ".";
  if (finding.size < 0)
    return "Two rows after " + at +
           " are closer together than the sampling: the clock was set back.";
  return "The time leaps by " + duration(finding.size) + " after " + at +
         " while all temperatures go on: the clock was put forward (summer time?).";
}

}  // namespace

void describe(Finding& finding, const std::vector<RunFile>& runs) {
  finding.text = sentence(finding, runs[finding.run]);
}

}  // namespace thermocomp::inspection
