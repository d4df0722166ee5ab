/// What the page and MQTT show of a snapshot: the daemon's answers, shortened and put in words.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// {"time_s", "here", "since_s", "why", "machine", "verdict": {"compensating", "intended",
/// "answer",
///  "detail", "level"}, "problems": [{"what", "remedy"}], "axes", "inputs", "sensors", "buses",
///  "controller", "model", "reference", "cycle", "history", "version", "lately"}. `level` is
///  "good",
/// "warning" or "bad". While the daemon is away only the first five keys and the verdict.
[[nodiscard]] nlohmann::json page_state(const Snapshot& snapshot, const std::string& machine);

/// The newest `most` events with their words, newest first:
/// [{"number", "wall_s", "kind", "text"}].
[[nodiscard]] nlohmann::json page_events(const Snapshot& snapshot, std::size_t most);

/// One sensor with blocks, values, fault in words, trend and suspicion.
/// @param sensor  of the method `sensors`
[[nodiscard]] nlohmann::json sensor_state(const nlohmann::json& sensor, const Snapshot& snapshot);

}  // namespace thermocomp::gateway
