#include <algorithm>
#include <cmath>

#include "cli/common/json_fields.hpp"
#include "cli/common/reason_text.hpp"
#include "cli/report/week_page.hpp"
#include "modelling/markup/html_page.hpp"

namespace thermocomp::cli {
namespace {

constexpr double drift_told_K = 0.5;
constexpr double drift_told_sd = 4.0;
constexpr double outage_told_s = 60.0;
constexpr double bound_told_share = 0.01;
/// A model that leaves more of what it takes out than this at the tool is worth looking at.
constexpr double left_told_share = 0.3;
constexpr double left_told_um = 2.0;

double rms_left_um(const MachineWeek& week, const std::string& axis, double& claimed_um,
                   std::size_t& count) {
  double squares = 0.0;
  double claims = 0.0;
  count = 0;
  for (const ProbingWeek& probing : week.probings) {
    if (probing.axis != axis || !std::isfinite(probing.left_um)) continue;
    squares += probing.left_um * probing.left_um;
    claims += probing.claimed_um * probing.claimed_um;
    ++count;
  }
  const double n = std::max(1.0, static_cast<double>(count));
  claimed_um = std::sqrt(claims / n);
  return std::sqrt(squares / n);
}

void add_outages(const MachineWeek& week, const std::string& kind,
                 std::vector<std::string>& lines) {
  for (const Outages& outages : week.outages) {
    if (!outages.subject.starts_with(kind)) continue;
    if (outages.lasted_s < outage_told_s && !outages.lasts && outages.count < 5) continue;
    const bool sensor = kind == "sensor ";
    const bool reason = kind == "reason ";
    const ReasonText text = sensor ? fault_text(outages.what) : reason_text(outages.what);
    std::string line = reason ? std::string(text.meaning) : outages.subject + ": ";
    if (!reason) line += sensor ? std::string(text.meaning) : outages.what;
    line += ", " + std::to_string(outages.count) + (outages.count == 1 ? " time, " : " times, ") +
            duration_text(outages.lasted_s) + " in all" + (outages.lasts ? ", and still" : "") +
            ".";
    if (!text.remedy.empty() && (sensor || reason))
      line += " Do: " + std::string(text.remedy) + ".";
    if (!sensor && !reason) line += " Look at its cable, its supply and its address.";
    lines.push_back(std::move(line));
  }
}

void add_sensors(const MachineWeek& week, std::vector<std::string>& lines) {
  for (const SensorWeek& sensor : week.sensors) {
    if (!(std::abs(sensor.drift_K) > drift_told_K &&
          std::abs(sensor.drift_K) > drift_told_sd * sensor.drift_sd_K))
      continue;
    lines.push_back("Sensor " + sensor.name + " drifted by " + figure_text(sensor.drift_K) +
                    " K against " + sensor.neighbour +
                    ", which otherwise moves like it: look at how both are fixed, and compare them "
                    "with a thermometer.");
  }
}

void add_axes(const MachineWeek& week, std::vector<std::string>& lines) {
  for (const AxisWeek& axis : week.axes) {
    const std::string unit = axis.unit == "urad" ? " µrad" : " µm";
    if (axis.at_bound_share > bound_told_share)
      lines.push_back("Axis " + axis.name + " stood at its bound of " + figure_text(axis.bound_um) +
                      unit + " for " + figure_text(100.0 * axis.at_bound_share) +
                      " % of the time: what lies beyond is not taken out. Find out why it is so "
                      "much before the bound is raised.");
    double claimed_um = 0.0;
    std::size_t count = 0;
    const double left_um = rms_left_um(week, axis.name, claimed_um, count);
    if (count > 0 && left_um > left_told_um && left_um > left_told_share * claimed_um)
      lines.push_back("Probings of " + axis.name + " found " + figure_text(left_um) + unit +
                      " left (RMS of " + std::to_string(count) +
                      "): export the week and let thermocomp diagnose say what the model lacks.");
  }
}

}  // namespace

std::vector<std::string> advice(const MachineWeek& week) {
  std::vector<std::string> lines;
  add_outages(week, "reason ", lines);
  add_outages(week, "axis ", lines);
  add_outages(week, "controller ", lines);
  add_outages(week, "sensor ", lines);
  add_outages(week, "bus ", lines);
  add_axes(week, lines);
  add_sensors(week, lines);
  if (week.dry_run)
    lines.emplace_back(
        "Nothing is written to the controller yet (dry run): compare the offsets "
        "with measured displacement, then switch it on.");
  else if (week.probings.empty() && week.mode_s("compensating") > 0.0)
    lines.emplace_back(
        "Nobody probed the tool in this time, so nothing says what is left at it: "
        "measure once warm and tell it, thermocomp measured AXIS UM.");
  if (!week.damage.empty())
    lines.emplace_back("Parts of the history are damaged: thermocomp history check says which.");
  return lines;
}

}  // namespace thermocomp::cli
