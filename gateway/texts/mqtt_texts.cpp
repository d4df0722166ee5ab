#include "gateway/texts/mqtt_texts.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <utility>

#include <nlohmann/json.hpp>

#include "gateway/feed/page_state.hpp"
#include "status/codes.hpp"
#include "status/verdict.hpp"

namespace thermocomp::gateway {
namespace {

using nlohmann::json;

json rounded(double value) {
  constexpr double per_unit = 1000.0;
  if (!std::isfinite(value)) return nullptr;
  return std::round(value * per_unit) / per_unit;
}

json status_state(const Snapshot& snapshot) {
  json state = {{"state", "online"}, {"daemon", snapshot.is_here ? "here" : "away"}};
  if (!snapshot.is_here) {
    state.update({{"compensating", false}, {"why", snapshot.why}});
    return state;
  }
  const Status& status = snapshot.status;
  json reasons = json::array();
  for (const Reason reason : members_of(status.reasons)) reasons.push_back(to_string(reason));
  state.update({{"compensating", is_compensating(status)},
                {"mode", code_text(status.mode, status.dry_run).name},
                {"enabled", status.enabled},
                {"reasons", std::move(reasons)},
                {"problems", problems_json(snapshot)},
                {"version", status.version}});
  return state;
}

json axis_state(const AxisStatus& axis) {
  return {{"unit", axis.unit},
          {"displacement_" + axis.unit, rounded(axis.displacement)},
          {"target_" + axis.unit, rounded(axis.target)},
          {"offset_" + axis.unit, rounded(axis.offset)},
          {"applied_" + axis.unit, rounded(axis.applied)},
          {"driven", axis.driven},
          {"at_bound", axis.at_bound},
          {"disagrees", axis.disagrees}};
}

json sensor_topic_state(const SensorStatus& sensor, const Snapshot& snapshot) {
  json state = sensor_json(sensor, snapshot);
  // The age changes constantly; `fault` covers stale readings.
  for (const char* key : {"name", "age_s"}) state.erase(key);
  for (const char* key : {"raw_degC", "smoothed_degC", "trend_K_per_h"})
    if (state[key].is_number()) state[key] = rounded(state[key].get<double>());
  return state;
}

json alarm_json(const Alarm& alarm) {
  return {{"name", alarm.condition.name},
          {"text", alarm.condition.text},
          {"remedy", alarm.condition.remedy},
          {"since_s", rounded(alarm.since_s)}};
}

}  // namespace

std::string distinct_name(std::string_view name, bool (*is_allowed)(char)) {
  constexpr std::string_view mark = "_0x";
  constexpr std::string_view digits = "0123456789ABCDEF";
  std::string made;
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (is_allowed(name[i]) && !name.substr(i).starts_with(mark)) {
      made += name[i];
      continue;
    }
    const auto byte = static_cast<unsigned char>(name[i]);
    made.append(mark) += digits[byte >> 4U];
    made += digits[byte & 0xFU];
  }
  return made;
}

std::string topic_of(const std::string& machine, const std::string& kind, const std::string& name) {
  std::string topic = "thermocomp/" + machine + "/" + kind;
  if (name.empty()) return topic;
  topic += '/';
  topic += distinct_name(name, [](char c) {
    return static_cast<unsigned char>(c) > ' ' && c != '/' && c != '+' && c != '#' && c != 127;
  });
  return topic;
}

std::string offline_payload() {
  return R"({"state":"offline"})";
}

std::vector<TopicState> topic_states(const Snapshot& snapshot, const std::string& machine) {
  std::vector<TopicState> list;
  list.push_back({topic_of(machine, "status"), status_state(snapshot)});
  if (!snapshot.is_here) return list;
  for (const SensorStatus& sensor : snapshot.sensors.sensors)
    list.push_back(
        {topic_of(machine, "sensor", sensor.name), sensor_topic_state(sensor, snapshot)});
  for (const AxisStatus& axis : snapshot.status.axes)
    list.push_back({topic_of(machine, "axis", axis.name), axis_state(axis)});
  return list;
}

json alarm_state(const std::vector<Alarm>& active, const AlarmChange* changed) {
  json list = json::array();
  for (const Alarm& alarm : active) list.push_back(alarm_json(alarm));
  json state = {{"active", std::move(list)}, {"changed", nullptr}};
  if (changed == nullptr) return state;
  state["changed"] = alarm_json(changed->alarm);
  state["changed"]["state"] = changed->is_raised ? "raised" : "cleared";
  return state;
}

std::string payload_of(const json& state, double wall_s) {
  json timed = {{"time", utc_text(wall_s)}};
  timed.update(state);
  return timed.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string utc_text(double wall_s) {
  constexpr double ms_per_s = 1000.0;
  const double ms = std::floor(std::isfinite(wall_s) && wall_s > 0.0 ? wall_s * ms_per_s : 0.0);
  const auto seconds = static_cast<std::time_t>(ms / ms_per_s);
  const auto rest = static_cast<int>(ms - static_cast<double>(seconds) * ms_per_s);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &parts);
  std::array<char, 8> fraction{};
  std::snprintf(fraction.data(), fraction.size(), ".%03dZ", rest % 1000);
  return std::string(text.data()) + fraction.data();
}

}  // namespace thermocomp::gateway
