/// The topics of a machine and what is published on them.
#pragma once

#include <string>
#include <vector>

#include "gateway/alarms/alarm_watch.hpp"
#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// `thermocomp/<machine>/<rest>`; what a topic must not have in a name becomes `_`.
[[nodiscard]] std::string topic_of(const std::string& machine, const std::string& kind,
                                   const std::string& name = "");

/// The last will, and what is said at an orderly end: {"state": "offline"}.
[[nodiscard]] std::string offline_payload();

/// One topic and its payload without the time. Numbers have three decimals: less is noise.
struct TopicState {
  std::string topic;
  nlohmann::json state;
};
/// status, sensor/<name>, axis/<name>. While the daemon is away only status.
[[nodiscard]] std::vector<TopicState> topic_states(const Snapshot& snapshot,
                                                   const std::string& machine);
/// {"active": [{"name", "text", "remedy", "since_s"}], "changed": {..., "state"} or null}.
[[nodiscard]] nlohmann::json alarm_state(const std::vector<Alarm>& active,
                                         const AlarmChange* changed);
/// `state` and "time": UTC, ISO 8601 with milliseconds.
[[nodiscard]] std::string payload_of(const nlohmann::json& state, double wall_s);
/// 2026-03-01T08:30:00.125Z
[[nodiscard]] std::string utc_text(double wall_s);

}  // namespace thermocomp::gateway
