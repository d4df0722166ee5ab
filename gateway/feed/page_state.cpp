#include "gateway/feed/page_state.hpp"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "status/codes.hpp"
#include "status/status_json.hpp"
#include "status/verdict.hpp"

namespace thermocomp::gateway {
namespace {

using nlohmann::json;

json verdict_of(const Snapshot& snapshot, const json& problems) {
  if (!snapshot.is_here)
    return {{"compensating", false},
            {"intended", false},
            {"answer", "not known"},
            {"detail", "the daemon does not answer"},
            {"level", "bad"}};
  const Verdict now = verdict(snapshot.status);
  const bool is_bad = !now.compensating && !now.intended;
  const char* level = is_bad ? "bad" : now.compensating && problems.empty() ? "good" : "warning";
  return {{"compensating", now.compensating},
          {"intended", now.intended},
          {"answer", now.answer},
          {"detail", now.detail},
          {"level", level}};
}

}  // namespace

json problems_json(const Snapshot& snapshot) {
  json list = json::array();
  if (!snapshot.is_here) {
    list.push_back({{"what", snapshot.why},
                    {"remedy", "systemctl status thermocompd; journalctl -u thermocompd"}});
    return list;
  }
  for (const Trouble& trouble : troubles(snapshot.status))
    list.push_back({{"what", trouble.what}, {"remedy", trouble.remedy}});
  return list;
}

json sensor_json(const SensorStatus& sensor, const Snapshot& snapshot) {
  json state = json_of(sensor);
  const CodeText fault = code_text(sensor.fault);
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
  if (!snapshot.is_here) return state;
  const Status& status = snapshot.status;
  json sensors = json::array();
  for (const SensorStatus& sensor : snapshot.sensors.sensors)
    sensors.push_back(sensor_json(sensor, snapshot));
  json lately = json::array();
  for (const Event& event : status.ended) lately.push_back(event_text(event));
  state.update(json_of(status));
  state["sensors"] = std::move(sensors);
  state["lately"] = std::move(lately);
  const json& model = *snapshot.model;
  state["model"]["made_from"] = model.is_object() ? model.value("made_from", json()) : json();
  return state;
}

json page_events(const Snapshot& snapshot, std::size_t most) {
  json list = json::array();
  const std::vector<Event>& events = *snapshot.events;
  for (auto event = events.rbegin(); event != events.rend() && list.size() < most; ++event)
    list.push_back({{"number", event->number},
                    {"wall_s", event->wall_s},
                    {"kind", to_string(event->kind)},
                    {"text", event_text(*event)}});
  return list;
}

}  // namespace thermocomp::gateway
