/// What the page and MQTT show of a snapshot: the daemon's answers, and their words.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// Of the answer of `status` what the page shows, as fine as it shows it, and {"time_s", "here",
/// "since_s", "why", "machine", "verdict":
/// {"compensating", "intended", "answer", "meaning", "since_s", "advice", "level"}, "problems":
/// [{"what", "remedy"}], "sensors"}. `level` is "good", "warning" (compensating, but something is
/// wrong), "off" (as an operator wants it) or "bad". While the daemon is away the rest
/// is what it said last; before its first answer only the first five keys, verdict and problems.
[[nodiscard]] nlohmann::json page_state(const Snapshot& snapshot, const std::string& machine);

/// What `after` has otherwise than `before`, for a receiver that has `before`: objects hold the
/// keys (of an array: the places) that changed, all other values replace. nullopt: it needs the
/// whole.
[[nodiscard]] std::optional<nlohmann::json> state_change(const nlohmann::json& before,
                                                         const nlohmann::json& after);

/// A line of the page: a command in the words of its button, and what happened without a daemon.
[[nodiscard]] std::string page_event_text(const Event& event);

/// The word for a command on the page, on its button and when it has been given.
[[nodiscard]] std::string_view command_name(std::string_view method);

/// The newest `most` happenings with their words, newest first, one a cause: what happened several
/// times is one, and what a link, a sensor or a command explains is left out. [{"number", "wall_s",
/// "kind", "text"}], `from_s` too where it is the time without a daemon.
[[nodiscard]] nlohmann::json page_events(const Snapshot& snapshot, std::size_t most);

/// Everything that is wrong: [{"what", "remedy", "about", "detail"}]; the last two where known,
/// `about` as "axis-z".
[[nodiscard]] nlohmann::json problems_json(const Snapshot& snapshot);

/// One sensor with blocks, values, fault in words, trend and suspicion.
[[nodiscard]] nlohmann::json sensor_json(const SensorStatus& sensor, const Snapshot& snapshot);

}  // namespace thermocomp::gateway
