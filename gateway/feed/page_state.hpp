/// Snapshot as JSON for the page and MQTT: the daemon's answers and their texts.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// Answer of `status`, reduced to what the page shows and its resolution, plus {"time_s", "here",
/// "since_s", "why", "machine", "verdict": {"compensating", "intended", "answer", "meaning",
/// "since_s", "advice", "level"}, "problems": [{"what", "remedy"}], "sensors"}. `level` is "good",
/// "warning" (compensating, but with problems), "off" (intended by the operator) or "bad". While
/// the daemon is away the other keys keep their last values; before its first answer only the first
/// five, verdict and problems exist.
[[nodiscard]] nlohmann::json page_state(const Snapshot& snapshot, const std::string& machine);

/// Change for a receiver that has `before`: objects hold the changed keys (of arrays: indices), all
/// other values replace. nullopt: the receiver needs the whole state.
[[nodiscard]] std::optional<nlohmann::json> state_change(const nlohmann::json& before,
                                                         const nlohmann::json& after);

/// Text of an event on the page; a command has the name of its button.
[[nodiscard]] std::string page_event_text(const Event& event);

/// Name of a command on its button and in events.
[[nodiscard]] std::string_view command_name(std::string_view method);

/// The newest `most` entries, newest first, one per cause: repeated events are merged, and effects
/// of a link, sensor or command are left out. [{"number", "wall_s", "kind", "text"}]; a time
/// without a daemon also has `from_s`.
[[nodiscard]] nlohmann::json page_events(const Snapshot& snapshot, std::size_t most);

/// [{"what", "remedy", "about", "detail"}] of all problems; `about` ("axis-z"), `detail` if known.
[[nodiscard]] nlohmann::json problems_json(const Snapshot& snapshot);

/// One sensor: blocks, values, fault with text, trend and suspicion.
[[nodiscard]] nlohmann::json sensor_json(const SensorStatus& sensor, const Snapshot& snapshot);

}  // namespace thermocomp::gateway
