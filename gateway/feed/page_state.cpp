#include "gateway/feed/page_state.hpp"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "cli/common/reason_text.hpp"
#include "cli/observe/events_text.hpp"
#include "cli/observe/troubles.hpp"

namespace thermocomp::gateway {
namespace {

using cli::list_of;
using cli::object_of;
using cli::text_of;
using nlohmann::json;

/// These keys of an object, null where they are not there.
json picked(const json& object, std::initializer_list<const char*> keys) {
  json some = json::object();
  for (const char* key : keys) some[key] = object.contains(key) ? object[key] : json(nullptr);
  return some;
}

json verdict_of(const Snapshot& snapshot, const json& problems) {
  if (!snapshot.is_here)
    return {{"compensating", false},
            {"intended", false},
            {"answer", "not known"},
            {"detail", ": the daemon does not answer"},
            {"level", "bad"}};
  const cli::Verdict told = cli::verdict(snapshot.status);
  const bool is_bad = !told.compensating && !told.intended;
  const char* level = is_bad ? "bad" : told.compensating && problems.empty() ? "good" : "warning";
  return {{"compensating", told.compensating},
          {"intended", told.intended},
          {"answer", told.answer},
          {"detail", told.detail},
          {"level", level}};
}

json problems_of(const Snapshot& snapshot) {
  json list = json::array();
  if (!snapshot.is_here) {
    list.push_back({{"what", snapshot.why},
                    {"remedy", "systemctl status thermocompd; journalctl -u thermocompd"}});
    return list;
  }
  for (const cli::Trouble& trouble : cli::troubles(snapshot.status))
    list.push_back({{"what", trouble.what}, {"remedy", trouble.remedy}});
  return list;
}

json axes_of(const json& status) {
  json list = json::array();
  for (const json& axis : list_of(status, "axes"))
    list.push_back(
        picked(axis, {"name", "unit", "displacement", "target", "offset", "applied", "driven",
                      "at_bound", "proving", "disagrees", "mismatch", "offset_sd"}));
  return list;
}

json inputs_of(const json& status) {
  json list = json::array();
  for (const json& input : list_of(status, "inputs"))
    list.push_back(picked(input, {"name", "block", "temp_degC", "reference_degC", "good",
                                  "estimated", "sd_K", "rate_K_per_h"}));
  return list;
}

json buses_of(const json& status) {
  json list = json::array();
  for (const json& bus : list_of(status, "buses")) {
    json units = json::array();
    for (const json& unit : list_of(bus, "units"))
      units.push_back(picked(unit, {"name", "answering", "last_error", "round_trip_ms"}));
    list.push_back(picked(bus, {"name", "kind", "connected", "last_error"}));
    list.back()["units"] = std::move(units);
  }
  return list;
}

}  // namespace

json sensor_state(const json& sensor, const Snapshot& snapshot) {
  json told = picked(sensor, {"name", "blocks", "raw_degC", "smoothed_degC", "age_s", "suspected"});
  const cli::ReasonText fault = cli::fault_text(text_of(sensor, "fault"));
  told["fault"] = text_of(sensor, "fault");
  told["fault_text"] = std::string(fault.meaning);
  told["fault_remedy"] = std::string(fault.remedy);
  const std::string name = text_of(sensor, "name");
  told["trend_K_per_h"] = snapshot.trends.contains(name) ? snapshot.trends[name] : json(nullptr);
  return told;
}

json page_state(const Snapshot& snapshot, const std::string& machine) {
  json problems = problems_of(snapshot);
  json state = {{"time_s", snapshot.wall_s},   {"here", snapshot.is_here},
                {"since_s", snapshot.since_s}, {"why", snapshot.why},
                {"machine", machine},          {"verdict", verdict_of(snapshot, problems)}};
  state["problems"] = std::move(problems);
  if (!snapshot.is_here) return state;
  const json& status = snapshot.status;
  json sensors = json::array();
  for (const json& sensor : list_of(snapshot.sensors, "sensors"))
    sensors.push_back(sensor_state(sensor, snapshot));
  json lately = json::array();
  for (const json& event : list_of(status, "ended")) lately.push_back(cli::event_text(event));
  json model = object_of(status, "model");
  model["made_from"] =
      snapshot.model->contains("made_from") ? (*snapshot.model)["made_from"] : json(nullptr);
  state.update(
      {{"axes", axes_of(status)},
       {"inputs", inputs_of(status)},
       {"sensors", std::move(sensors)},
       {"buses", buses_of(status)},
       {"controller", picked(object_of(status, "controller"),
                             {"name", "kind", "online", "connected", "last_error", "signals"})},
       {"model", std::move(model)},
       {"reference", picked(object_of(status, "reference"), {"by", "wall_s", "lost"})},
       {"cycle", picked(object_of(status, "cycle"),
                        {"rate_hz", "count", "missed", "lateness_us_p999", "real_time"})},
       {"history", picked(object_of(status, "history"),
                          {"enabled", "working", "size_MB", "last_commit_age_s", "last_error"})},
       {"mode", text_of(status, "mode")},
       {"version", text_of(status, "version")},
       {"uptime_s", status.contains("uptime_s") ? status["uptime_s"] : json(nullptr)},
       {"lately", std::move(lately)}});
  return state;
}

json page_events(const Snapshot& snapshot, std::size_t most) {
  json list = json::array();
  if (!snapshot.events->is_array()) return list;
  for (auto event = snapshot.events->rbegin(); event != snapshot.events->rend(); ++event) {
    if (list.size() == most) break;
    list.push_back({{"number", cli::count_of(*event, "number")},
                    {"wall_s", event->contains("wall_s") ? (*event)["wall_s"] : json(nullptr)},
                    {"kind", text_of(*event, "kind")},
                    {"text", cli::event_text(*event)}});
  }
  return list;
}

}  // namespace thermocomp::gateway
