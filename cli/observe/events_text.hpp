/// Events of a daemon as lines for a person.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

/// "sensor bed_front: not renewed in time: over, lasted 28.1 s" and the like, without time and
/// kind.
[[nodiscard]] std::string event_text(const nlohmann::json& event);
/// A wall time (seconds since 1970) as the clock here shows it, with a tenth; "-" for NaN.
[[nodiscard]] std::string local_time(double wall_s);
/// One line an event, oldest first: local time, kind, text.
/// @param events  the daemon's answer to `events`
[[nodiscard]] std::string events_text(const nlohmann::json& events);

}  // namespace thermocomp::cli
