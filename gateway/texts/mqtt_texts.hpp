/// The topics of a machine and what is published on them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "gateway/alarms/alarm_watch.hpp"
#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// A name for a place that allows fewer characters. Two names never become alike, and what a name
/// becomes depends on it alone: each byte that is not allowed is `_0x` and two digits ("a b" is
/// a_0x20b), and so is the `_` of a `_0x` that a name has itself.
[[nodiscard]] std::string distinct_name(std::string_view name, bool (*is_allowed)(char));

/// `thermocomp/<machine>/<rest>`; a topic's name has neither `/`, `+`, `#` nor blanks.
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
