#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>

#include <nlohmann/json.hpp>

#include "config/text/units.hpp"
#include "estimator/types.hpp"
#include "modelling/inspection/checks.hpp"
#include "modelling/inspection/inspection.hpp"
#include "report/html_page.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::inspection {

namespace {

using Json = nlohmann::ordered_json;

double rounded(double value) {
  if (!(std::abs(value) > 0) || !std::isfinite(value)) return value;
  const double scale = std::pow(10.0, 3.0 - std::floor(std::log10(std::abs(value))));
  return std::round(value * scale) / scale;
}

Json json_of(const Finding& finding, const Inspection& inspection) {
  Json json;
  json["kind"] = finding.kind;
  json["column"] = finding.column.empty() ? Json(nullptr) : Json(finding.column);
  if (!finding.other.empty()) json["other"] = finding.other;
  json["run"] = inspection.runs[finding.run].file;
  json["at_s"] = finding.at_s;
  json["until_s"] = finding.until_s;
  json["size"] = rounded(finding.size);
  json["unit"] = finding.unit;
  json["probability"] = std::round(1000.0 * finding.probability) / 1000.0;
  json["score"] = rounded(finding.score);
  json["text"] = finding.text;
  if (!finding.times_s.empty()) json["times_s"] = finding.times_s;
  return json;
}

std::string two_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text,
                std::abs(value) >= 100 && std::abs(value) < 1e6 ? "%.0f" : "%.2g", value);
  return text;
}

/// Time after the run's first row: "3 h 20 min".
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
  const char* direction = finding.size > 0 ? " up by " : " down by ";
  constexpr double kelvin_of_0_degC = 273.15;
  if (kind == "spikes" && is_operating(finding.column))
    return finding.column + " has stray values (" + count + ") of up to " + size +
           ", beyond five times all others: a code of the controller? Leave these rows out.";
  if (kind == "spikes" && finding.times_s.size() > 20 &&
      std::abs(std::abs(finding.size) - kelvin_of_0_degC) < 15.0)
    return finding.column + " reads about 273 K " + (finding.size > 0 ? "more" : "less") + " in " +
           count + " rows, from " + at + " on: " + (finding.size > 0 ? "these" : "the others") +
           " are in kelvin. Subtract 273.15 there.";
  if (kind == "spikes")
    return finding.column + " has spikes (" + count + ") of up to " + size +
           ": check its plug and its shield, and leave these values out.";
  if (kind == "outliers")
    return finding.column + " has outliers (" + count + ") of up to " + size +
           ": probings that failed, or chips. Leave these values out.";
  if (kind == "sensor_step")
    return finding.column + " jumps" + direction + size + " after " + at +
           " and stays there; its neighbours do not: the sensor moved, or its contact or channel "
           "changed.";
  if (kind == "sensor_drift")
    return finding.column + " drifts" + direction + size + " from " + at +
           " to the end of the run; its neighbours do not: the sensor ages or comes off.";
  if (kind == "sensor_loose")
    return finding.column + " shows only " + std::to_string(std::lround(100 * finding.size)) +
           " % of the motion that its neighbours predict, from " + at +
           " on: the sensor has come loose and measures the air.";
  if (kind == "sensor_swap")
    return finding.column + " and " + finding.other +
           " agree with the other runs only when exchanged: check the plugs. They differ by " +
           size + ".";
  if (kind == "stuck")
    return finding.column + " stays at one value from " + at + " to " +
           moment(finding.until_s, run) + " while other places change by " + size +
           (is_output(finding.column) ? ": the probe or its channel is stuck."
                                      : ": the channel is stuck, or this is a setpoint.");
  if (kind == "coarse")
    return finding.column + " is recorded in steps of " + size +
           ", which hide smaller changes: record it with more digits.";
  if (kind == "unit" && finding.unit == "times")
    return finding.column + " agrees with the others only if divided by " +
           two_digits(finding.size) +
           (finding.other.empty() ? ""
                                  : " (or the other run's is multiplied: two do not show which)") +
           ": check its unit, its scale and its wiring.";
  if (kind == "noise")
    return finding.column + " has " + two_digits(finding.size) + " times its usual noise from " +
           at + " to " + moment(finding.until_s, run) +
           ", and nothing else has: check its plug, its shield and its supply.";
  if (kind == "clock" && finding.unit == "times")
    return "All temperatures change as if time_s were in minutes: multiply it by 60, or name the "
           "unit in the file of --columns (time_unit = \"min\").";
  if (kind == "unit")
    return finding.column +
           " agrees with the others if it is in kelvin, though its name says degC: then subtract "
           "273.15.";
  if (kind == "copy")
    return finding.column + " equals " + finding.other +
           " throughout: one channel was recorded twice.";
  if (kind == "displacement_step")
    return finding.column + " jumps" + direction + size + " after " + at +
           " without a change of temperature or operation: the probe, the work or the zero was "
           "moved.";
  if (kind == "gap")
    return (finding.column.empty()  ? "Nothing was recorded"
            : finding.other.empty() ? finding.column + " has no value"
                                    : finding.column + ", " + finding.other + " have no value") +
           " for " + duration(finding.size) + " after " + at + ".";
  if (finding.size < 0)
    return "Two rows after " + at +
           " are closer together than the sampling interval: the clock was set back.";
  return "The time jumps by " + duration(finding.size) + " after " + at +
         " while all temperatures continue: the clock was set forward (summer time?).";
}

}  // namespace

void describe(Finding& finding, const std::vector<RunFile>& runs) {
  finding.text = sentence(finding, runs[finding.run]);
}

std::vector<std::string> alike(const Inspection& inspection) {
  std::vector<std::string> groups;
  for (const auto& group : inspection.groups) {
    if (group.size() < 2) continue;
    std::string& names = groups.emplace_back();
    for (const std::string& name : group) names += (names.empty() ? "" : ", ") + name;
  }
  return groups;
}

std::string step_text(double step_s) {
  const bool in_hours = step_s >= 7200.0;
  const bool in_minutes = !in_hours && step_s >= 120.0;
  char text[32];
  std::snprintf(text, sizeof text, in_hours || in_minutes ? "%.3g" : "%.4g",
                step_s / (in_hours     ? 3600.0
                          : in_minutes ? 60.0
                                       : 1.0));
  return std::string(text) + (in_hours ? " h" : in_minutes ? " min" : " s");
}

std::string inspection_json(const Inspection& inspection, const std::string& departure) {
  Json json;
  json["runs"] = Json::array();
  for (const RunSampling& run : inspection.runs) {
    Json gaps = Json::array();
    for (const auto& [from_s, to_s] : run.gaps) gaps.push_back({from_s, to_s});
    json["runs"].push_back(
        {{"file", run.file}, {"rows", run.rows}, {"step_s", run.step_s}, {"gaps", gaps}});
  }
  json["groups"] = inspection.groups;
  json["excited"] = Json::object();
  for (const auto& [name, excited] : inspection.excited) json["excited"][name] = excited;
  json["experiments"] = inspection.experiments;
  json["findings"] = Json::array();
  for (const Finding& finding : inspection.findings)
    json["findings"].push_back(json_of(finding, inspection));
  if (!departure.empty()) json["departure"] = Json::parse(departure);
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string inspection_text(const Inspection& inspection) {
  std::string text;
  char line[160];
  for (const RunSampling& run : inspection.runs) {
    text += run.file + ": " + std::to_string(run.rows) + " rows, one every " +
            step_text(run.step_s) + ", " + std::to_string(run.gaps.size()) +
            (run.gaps.size() == 1 ? " gap\n" : " gaps\n");
  }
  text += "\n";
  if (inspection.findings.empty()) text += "No faults found in these recordings.\n";
  for (const Finding& finding : inspection.findings) {
    std::snprintf(line, sizeof line, "%3.0f %%  ", 100 * finding.probability);
    text += line + inspection.runs[finding.run].file + ": " + finding.text + "\n";
  }
  const std::vector<std::string> groups = alike(inspection);
  text.append("\n")
      .append(groups.empty() ? none_alike : "Places that correlate above 0.98:")
      .append("\n");
  for (const std::string& group : groups) text.append("  ").append(group).append("\n");
  if (!inspection.experiments.empty()) text += "\nExperiments that would show more:\n";
  for (const std::string& experiment : inspection.experiments) text += "  " + experiment + "\n";
  return text;
}

namespace {

/// Plots one column over the run's hours, with the finding's stretch and moments marked.
std::string picture(const RunFile& run, const std::string& column, double from_s, double to_s,
                    const Finding& finding) {
  const auto& time_s = run.time_s();
  const auto row_at = [&](double at_s) {
    const auto row = std::lower_bound(time_s.begin(), time_s.end(), at_s);
    return static_cast<std::size_t>(row - time_s.begin());
  };
  const std::size_t begin = row_at(from_s);
  const std::size_t count = std::max(begin + 1, row_at(to_s)) - begin;
  const std::span values = std::span(run.column(column)).subspan(begin, count);
  const std::span times = std::span(time_s).subspan(begin, count);
  std::vector<double> since_start_s(times.begin(), times.end());
  for (double& at_s : since_start_s) at_s -= time_s.front();
  std::vector<double> marks(count, not_a_number);
  for (const double at_s : finding.times_s) {
    const std::size_t row = row_at(at_s) - begin;  // wraps to a large number before `begin`
    if (row < count) marks[row] = values[row];
  }
  std::vector<PlotSpan> spans;
  if (finding.times_s.empty()) {
    const double seen_s = 0.002 * (since_start_s.back() - since_start_s.front());
    const double at_s = finding.at_s - time_s.front();
    spans.push_back({"", at_s, std::max(finding.until_s - time_s.front(), at_s + seen_s)});
  }
  return html_figure(panels_plot(since_start_s,
                                 {{column,
                                   std::string(unit_of(column).symbol),
                                   {{"", "#2b6cb0", values}, {"", "#c53030", marks, true}}}},
                                 spans),
                     "");
}

/// The place most similar to the finding's, for comparison.
std::string neighbour_of(const Inspection& inspection, const Finding& finding, const RunFile& run) {
  if (finding.kind == "gap") return "";
  if (!finding.other.empty()) return finding.other;
  if (!is_temperature(finding.column)) return "";
  for (const auto& group : inspection.groups) {
    if (std::find(group.begin(), group.end(), finding.column) == group.end()) continue;
    for (const std::string& name : group)
      if (name != finding.column && run.find(name)) return name;
  }
  return "";
}

std::string finding_html(const std::vector<RunFile>& runs, const Inspection& inspection,
                         const Finding& finding) {
  const RunFile& run = runs[finding.run];
  std::string html = html_heading((finding.column.empty() ? finding.kind : finding.column) + ", " +
                                  std::to_string(std::lround(100 * finding.probability)) + " %") +
                     html_paragraph(finding.text + " (" + run.name + ")");
  if (!run.find(finding.column)) return html;
  const double first_s = run.time_s().front();
  const double last_s = run.time_s().back() + 1e-6;
  html += picture(run, finding.column, first_s, last_s, finding);
  const bool sudden = finding.kind == "sensor_step" || finding.kind == "displacement_step" ||
                      finding.kind == "sensor_loose";
  const double near_s = 0.03 * (last_s - first_s);
  if (sudden)
    html += html_paragraph("Enlarged:", "small") +
            picture(run, finding.column, finding.at_s - near_s, finding.at_s + near_s, finding);
  const std::string neighbour = neighbour_of(inspection, finding, run);
  if (!neighbour.empty())
    html += html_paragraph("For comparison, a place that moves alike:", "small") +
            picture(run, neighbour, first_s, last_s, finding);
  return html;
}

std::string runs_table(const Inspection& inspection) {
  std::vector<std::vector<std::string>> rows{{"file", "rows", "one every", "gaps"}};
  for (const RunSampling& run : inspection.runs)
    rows.push_back({run.file, std::to_string(run.rows), step_text(run.step_s),
                    std::to_string(run.gaps.size())});
  return html_heading("The recordings") + html_table(rows);
}

}  // namespace

std::string inspection_html(const std::vector<RunFile>& runs, const Inspection& inspection) {
  std::string html = html_begin("Faults of the recordings");
  html += html_paragraph(inspection.findings.empty() ? "No faults were found in these recordings."
                                                     : std::to_string(inspection.findings.size()) +
                                                           " found, in order of probability.");
  for (const Finding& finding : inspection.findings)
    html += finding_html(runs, inspection, finding);
  html += runs_table(inspection);
  const std::vector<std::string> groups = alike(inspection);
  html += groups.empty() ? html_paragraph(none_alike)
                         : html_heading("Places that correlate above 0.98") + html_list(groups);
  if (!inspection.experiments.empty())
    html += html_heading("Experiments that would show more") + html_list(inspection.experiments);
  return html + html_end();
}

}  // namespace thermocomp::inspection
