#include "gateway/feed/page_state.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>

#include <nlohmann/json.hpp>

#include "status/codes.hpp"
#include "status/figures.hpp"
#include "status/status.hpp"
#include "status/verdict.hpp"

namespace thermocomp::gateway {
namespace {

using nlohmann::json;

json verdict_of(const Snapshot& snapshot, const json& problems) {
  if (!snapshot.is_here)
    return {{"compensating", false},
            {"intended", false},
            {"answer", "not known"},
            {"meaning", "the daemon does not answer"},
            {"since_s", std::round(snapshot.since_s)},
            {"advice", ""},
            {"level", "bad"}};
  const Verdict now = verdict(snapshot.status);
  const bool is_good = now.compensating && problems.empty();
  const char* level = is_good            ? "good"
                      : now.compensating ? "warning"
                      : now.intended     ? "off"
                                         : "bad";
  return {{"compensating", now.compensating},
          {"intended", now.intended},
          {"answer", now.answer},
          {"meaning", now.meaning},
          {"since_s",
           std::isfinite(now.for_s) ? json(std::round(snapshot.wall_s - now.for_s)) : json()},
          {"advice", now.compensating && !is_good ? "there are problems, see below" : now.advice},
          {"level", level}};
}

/// "; the controller keeps the last offsets: X +5.5 um, Z -3.0 um"
std::string last_offsets(const Status& status) {
  std::vector<std::string> list;
  for (const AxisStatus& axis : status.axes)
    if (std::isfinite(axis.offset))
      list.push_back(axis.name + " " + fixed_signed(axis.offset, 1) + " " + axis.unit);
  return list.empty() ? "" : "; the controller keeps the last offsets: " + joined(list);
}

void keep(json& object, std::initializer_list<const char*> keys) {
  json kept = json::object();
  for (const char* key : keys)
    if (object.contains(key)) kept[key] = std::move(object[key]);
  object = std::move(kept);
}

void round_numbers(json& value, double steps_per_unit) {
  if (value.is_number_float())
    value = std::round(value.get<double>() * steps_per_unit) / steps_per_unit;
  if (value.is_structured())
    for (json& part : value) round_numbers(part, steps_per_unit);
}

/// Drops counters and digits that the page does not show, so that they cause no changes.
void keep_what_is_shown(json& state) {
  keep(state, {"time_s",   "here",       "since_s",   "why",       "machine", "verdict",
               "problems", "mode",       "axes",      "probe_due", "warm",    "sensors",
               "buses",    "controller", "model",     "reference", "version", "uptime_s",
               "cycle",    "history",    "candidate", "dry_run"});
  for (json& axis : state["axes"])
    keep(axis, {"name", "unit", "offset", "offset_max", "offset_sd", "applied", "driven",
                "disagrees", "mismatch", "at_bound", "proving"});
  for (json& sensor : state["sensors"]) {
    keep(sensor, {"name", "blocks", "raw_degC", "smoothed_degC", "fault", "fault_text",
                  "fault_remedy", "suspected", "trend_K_per_h", "age_s", "jump", "settles"});
    const bool is_good = sensor["fault"] == to_string(Fault::none);
    if (is_good && sensor["smoothed_degC"].is_number()) sensor["raw_degC"] = nullptr;
    if (is_good) sensor["age_s"] = nullptr;
    round_numbers(sensor["age_s"], 1.0);
    round_numbers(sensor["trend_K_per_h"], 10.0);
  }
  for (json& bus : state["buses"]) {
    keep(bus, {"name", "kind", "connected", "last_error", "units"});
    for (json& unit : bus["units"]) keep(unit, {"name", "answering"});
  }
  for (json& warm : state["warm"]) round_numbers(warm, 1.0);
  keep(state["controller"], {"name", "kind", "online", "last_error", "signals"});
  keep(state["cycle"], {"rate_hz", "missed"});
  keep(state["history"], {"enabled", "size_MB"});
  round_numbers(state["history"], 10.0);
  round_numbers(state["uptime_s"], 1.0 / 60.0);
  round_numbers(state["time_s"], 10.0);
  round_numbers(state, 100.0);
}

bool add_changes(const json& before, const json& after, json& changes) {
  if (before.size() != after.size()) return false;
  for (const auto& [key, value] : after.items()) {
    const bool is_known = before.is_array() || before.contains(key);
    if (!is_known) return false;
    const json& old = before.is_array() ? before[std::stoul(key)] : before[key];
    if (old == value) continue;
    json part = json::object();
    const bool is_alike = value.is_structured() && old.type() == value.type();
    if (is_alike && add_changes(old, value, part))
      changes[key] = std::move(part);
    else if (value.is_object() && is_alike)
      return false;  // the receiver would merge it instead of replacing the old one
    else
      changes[key] = value;
  }
  return true;
}

}  // namespace

std::optional<json> state_change(const json& before, const json& after) {
  json changes = json::object();
  if (!before.is_object() || !add_changes(before, after, changes)) return std::nullopt;
  return changes;
}

json problems_json(const Snapshot& snapshot) {
  json list = json::array();
  if (!snapshot.is_here) {
    list.push_back({{"what", "thermocompd is not running, or does not answer"},
                    {"remedy", "ask maintenance to start the service thermocompd" +
                                   last_offsets(snapshot.status)},
                    {"detail", snapshot.why}});
    return list;
  }
  for (const Trouble& trouble : troubles(snapshot.status, &snapshot.sensors)) {
    json entry = {{"what", trouble.what}, {"remedy", trouble.remedy}};
    if (!trouble.command.empty()) entry["command"] = trouble.command;
    if (!trouble.detail.empty()) entry["detail"] = trouble.detail;
    if (trouble.subject.kind != SubjectKind::nothing)
      entry["about"] = std::string(to_string(trouble.subject.kind)) + "-" + trouble.subject.name;
    list.push_back(std::move(entry));
  }
  return list;
}

json sensor_json(const SensorStatus& sensor, const Snapshot& snapshot) {
  json state = json_of(sensor);
  const CodeText fault = fault_text(sensor);
  state["settles"] = settles(sensor);
  state["fault_text"] = fault.meaning;
  state["fault_remedy"] = fault.remedy;
  const auto trend = snapshot.trends.find(sensor.name);
  const bool is_known = trend != snapshot.trends.end() && std::isfinite(trend->second);
  state["trend_K_per_h"] = is_known ? json(trend->second) : json(nullptr);
  return state;
}

json page_state(const Snapshot& snapshot, const std::string& machine) {
  json problems = problems_json(snapshot);
  json state = {{"time_s", snapshot.wall_s},   {"here", snapshot.is_here},
                {"since_s", snapshot.since_s}, {"why", snapshot.why},
                {"machine", machine},          {"verdict", verdict_of(snapshot, problems)}};
  state["problems"] = std::move(problems);
  const Status& status = snapshot.status;
  if (status.axes.empty()) return state;  // no answer of the daemon yet
  json sensors = json::array();
  for (const SensorStatus& sensor : snapshot.sensors.sensors)
    sensors.push_back(sensor_json(sensor, snapshot));
  state.update(json_of(status));
  state["sensors"] = std::move(sensors);
  const json& model = *snapshot.model;
  state["model"]["made_from"] = model.is_object() ? model.value("made_from", json()) : json();
  keep_what_is_shown(state);
  return state;
}

}  // namespace thermocomp::gateway
