#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <string>
#include <vector>

#include "cli/report/week_page.hpp"
#include "report/html_page.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

constexpr double drift_listed_K = 0.5;
constexpr double drift_listed_sd = 4.0;
constexpr double outage_listed_s = 60.0;
constexpr double bound_listed_share = 0.01;
/// Ratio of remaining to compensated displacement above which a model is listed.
constexpr double left_listed_share = 0.3;
constexpr double left_listed_um = 2.0;

/// RMS remaining displacement of all probings, dry runs included.
/// @param claimed_um  RMS of the offsets
double rms_left_um(const MachineWeek& week, const std::string& axis, double& claimed_um,
                   std::size_t& count) {
  double squares = 0.0;
  double claims = 0.0;
  count = 0;
  for (const ProbingWeek& probing : week.probings) {
    if (probing.axis != axis || !std::isfinite(probing.left_um)) continue;
    squares += probing.left_um * probing.left_um;
    claims += probing.offset_um * probing.offset_um;
    ++count;
  }
  const double n = std::max(1.0, static_cast<double>(count));
  claimed_um = std::sqrt(claims / n);
  return std::sqrt(squares / n);
}

bool is_listed(const OutageTimes& kind) {
  return kind.lasted_s >= outage_listed_s || kind.lasts || kind.count >= 5;
}

std::string how_often(const OutageTimes& kind) {
  return std::to_string(kind.count) + (kind.count == 1 ? " time, " : " times, ") +
         duration_text(kind.lasted_s) + " in all" + (kind.lasts ? ", and still" : "") + ".";
}

std::string as_a_sentence(std::string text) {
  if (!text.empty()) text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return text;
}

std::string what_to_do(const CodeText& text) {
  return text.remedy.empty() ? "" : " Do: " + with_command(text.remedy, text.command) + ".";
}

bool any_listed(const MachineWeek& week, SubjectKind subject) {
  return std::any_of(week.outages.begin(), week.outages.end(), [subject](const Outages& outages) {
    return outages.subject.kind == subject && is_listed(outages);
  });
}

/// True if lines of sensors, axes or the controller are more specific.
bool is_listed_by_its_cause(const MachineWeek& week, Reason reason) {
  switch (reason) {
    case Reason::sensor_suspected:
    case Reason::at_bound:
      return true;
    case Reason::block_lost:
    case Reason::block_estimated:
    case Reason::sensor_unconfirmed:
      return any_listed(week, SubjectKind::sensor);
    case Reason::controller_offline:
    case Reason::not_written:
      return any_listed(week, SubjectKind::controller);
    default:
      return false;
  }
}

void add_reasons(const MachineWeek& week, std::vector<std::string>& lines) {
  for (const Outages& outages : week.outages) {
    const auto reason = reason_named(outages.last.code);
    if (outages.subject.kind != SubjectKind::reason || !reason) continue;
    if (is_listed_by_its_cause(week, *reason)) continue;
    const CodeText text = code_text(*reason);
    if (is_listed(outages))
      lines.push_back(as_a_sentence(std::string(text.meaning)) + ", " + how_often(outages) +
                      what_to_do(text));
  }
}

void add_devices(const MachineWeek& week, std::initializer_list<SubjectKind> kinds,
                 const char* what_to_do, std::vector<std::string>& lines) {
  for (const Outages& outages : week.outages) {
    if (std::find(kinds.begin(), kinds.end(), outages.subject.kind) == kinds.end()) continue;
    if (is_listed(outages))
      lines.push_back(as_a_sentence(subject_text(outages.subject)) + ": " +
                      what_text(outages.last) + ", " + how_often(outages) + what_to_do);
  }
}

/// Sensors with the same fault, count and duration share a line, since a bus fault affects all of
/// its sensors.
void add_sensor_faults(const MachineWeek& week, std::vector<std::string>& lines) {
  struct Group {
    std::string code;
    OutageTimes kind;
    std::vector<std::string> sensors;
  };
  std::vector<Group> groups;
  for (const Outages& outages : week.outages) {
    if (outages.subject.kind != SubjectKind::sensor) continue;
    for (const auto& [code, kind] : outages.kinds) {
      if (!is_listed(kind)) continue;
      const auto alike = [&code = code, &kind = kind](const Group& group) {
        return group.code == code && group.kind.count == kind.count &&
               group.kind.lasts == kind.lasts &&
               std::abs(group.kind.lasted_s - kind.lasted_s) < outage_listed_s;
      };
      auto group = std::find_if(groups.begin(), groups.end(), alike);
      if (group == groups.end()) group = groups.insert(group, {code, kind, {}});
      group->sensors.push_back(outages.subject.name);
    }
  }
  std::stable_sort(groups.begin(), groups.end(), [](const Group& a, const Group& b) {
    return a.kind.lasted_s > b.kind.lasted_s;
  });
  for (const Group& group : groups) {
    const CodeText text = code_text(fault_named(group.code).value_or(Fault::device_error));
    lines.push_back((group.sensors.size() == 1 ? "Sensor " : "Sensors ") + joined(group.sensors) +
                    ": " + std::string(text.meaning) + ", " + how_often(group.kind) +
                    what_to_do(text));
  }
}

void add_suspicions(const MachineWeek& week, std::vector<std::string>& lines) {
  for (const Outages& outages : week.outages) {
    if (outages.subject.kind != SubjectKind::suspected_sensor) continue;
    lines.push_back(
        "Sensor " + outages.subject.name + " is suspected: " + what_text(outages.last) + ", " +
        how_often(outages) +
        " Do: check its contact, its place and its wiring; compare it with a thermometer. If the "
        "reading is correct, take a new reference: thermocomp reference.");
  }
}

bool is_suspected(const MachineWeek& week, const std::string& sensor) {
  return std::any_of(week.outages.begin(), week.outages.end(), [&](const Outages& outages) {
    return outages.subject == Subject{SubjectKind::suspected_sensor, sensor};
  });
}

void add_sensors(const MachineWeek& week, std::vector<std::string>& lines) {
  for (const SensorWeek& sensor : week.sensors) {
    if (!(std::abs(sensor.drift_K) > drift_listed_K &&
          std::abs(sensor.drift_K) > drift_listed_sd * sensor.drift_sd_K))
      continue;
    // already reported in more detail
    if (is_suspected(week, sensor.name) || is_suspected(week, sensor.neighbour)) continue;
    lines.push_back("Sensor " + sensor.name + " drifted by " + figure_text(sensor.drift_K) +
                    " K against " + sensor.neighbour +
                    ", which otherwise moves like it: check how both are fixed, and compare them "
                    "with a thermometer.");
  }
}

void add_axes(const MachineWeek& week, std::vector<std::string>& lines) {
  for (const AxisWeek& axis : week.axes) {
    const std::string unit = axis.unit == "urad" ? " µrad" : " µm";
    if (axis.sent.at_bound_share > bound_listed_share)
      lines.push_back("Axis " + axis.name + " was at its bound of " + figure_text(axis.bound_um) +
                      unit + " for " + figure_text(100.0 * axis.sent.at_bound_share) +
                      " % of the time: displacement beyond it is not compensated. Find the cause "
                      "before the bound is raised.");
    double claimed_um = 0.0;
    std::size_t count = 0;
    const double left_um = rms_left_um(week, axis.name, claimed_um, count);
    if (count > 0 && left_um > left_listed_um && left_um > left_listed_share * claimed_um)
      lines.push_back("Probings of " + axis.name + " found " + figure_text(left_um) + unit +
                      " left (RMS of " + std::to_string(count) +
                      "): export the week and find the missing effects with thermocomp diagnose.");
  }
}

}  // namespace

std::vector<std::string> advice(const MachineWeek& week) {
  std::vector<std::string> lines;
  add_reasons(week, lines);
  constexpr const char* to_device = " Look at its cable, its supply and its address.";
  add_devices(week, {SubjectKind::axis},
              " Compare the offset with the controller's read-back and remove the cause before "
              "thermocomp release.",
              lines);
  add_devices(week, {SubjectKind::controller, SubjectKind::controller_errors}, to_device, lines);
  add_devices(week, {SubjectKind::bus, SubjectKind::bus_errors}, to_device, lines);
  add_sensor_faults(week, lines);
  add_suspicions(week, lines);
  add_axes(week, lines);
  add_sensors(week, lines);
  constexpr double long_s = 600.0;
  if (week.mode_s(zero_model) > 0.0)
    lines.emplace_back(
        "Every coefficient of the model is 0, so nothing is compensated: make a model, as in "
        "identification.md.");
  if (const double lost_s = week.mode_s(not_recorded); lost_s > long_s)
    lines.push_back("Nothing was recorded for " + duration_text(lost_s) +
                    " of a daemon's run: see whether the history's disk was full, and whether the "
                    "clock was set.");
  if (week.dry_run)
    lines.emplace_back(
        "Nothing is written to the controller yet (dry run): compare the offsets "
        "with measured displacement, then switch it on.");
  else if (week.probings.empty() && week.mode_s("compensating") > 0.0)
    lines.emplace_back(
        "The tool was not probed in this time, so its remaining error is unknown: "
        "measure it once warm and enter it: thermocomp measured AXIS UM.");
  if (!week.damage.empty())
    lines.emplace_back("Parts of the history are damaged: see thermocomp history check.");
  return lines;
}

}  // namespace thermocomp::cli
