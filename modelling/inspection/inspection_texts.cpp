#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include "modelling/inspection/inspection.hpp"

namespace thermocomp::inspection {
namespace {

using Json = nlohmann::ordered_json;

/// Four digits: more would be none.
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

}  // namespace

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
  text.append("\n").append(groups.empty() ? none_alike : "Places that move alike:").append("\n");
  for (const std::string& group : groups) text.append("  ").append(group).append("\n");
  if (!inspection.experiments.empty()) text += "\nWhat would tell more:\n";
  for (const std::string& experiment : inspection.experiments) text += "  " + experiment + "\n";
  return text;
}

}  // namespace thermocomp::inspection
