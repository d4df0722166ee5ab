/// Parser and formatter for times in a history.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace thermocomp {

/// Seconds since the history's first cycle, or wall time [ns since 1970].
struct HistoryTime {
  std::optional<double> seconds;
  std::optional<std::int64_t> wall_ns;
};

/// True if from <= time < to, as far as they are given.
/// @param seconds  since the history's first cycle
[[nodiscard]] inline bool is_within(double seconds, std::int64_t wall_ns,
                                    const std::optional<HistoryTime>& from,
                                    const std::optional<HistoryTime>& to) {
  const auto is_before = [&](const HistoryTime& bound) {
    return bound.seconds ? seconds < *bound.seconds : wall_ns < *bound.wall_ns;
  };
  return !(from && is_before(*from)) && (!to || is_before(*to));
}

/// "12.5": seconds since the history's start. "2026-03-01T08:30:00", "2026-03-01 08:30",
/// "2026-03-01" (midnight): local unless it ends with Z or +hh:mm. "now", "8 hours ago", "90 min
/// ago", "-8h", "-1.5d": before `now`; units s, m or min, h, d, w, and their English words.
/// @param now  wall clock, since 1970
/// @throws std::invalid_argument naming the text
[[nodiscard]] HistoryTime parse_history_time(
    const std::string& text,
    std::chrono::nanoseconds now = std::chrono::system_clock::now().time_since_epoch());

/// nullopt for an empty text. @throws std::invalid_argument
[[nodiscard]] inline std::optional<HistoryTime> time_or_none(const std::string& text) {
  return text.empty() ? std::nullopt : std::optional(parse_history_time(text));
}

/// "2026-03-01T08:30:00.123Z"
[[nodiscard]] std::string utc_text(std::int64_t wall_ns);

}  // namespace thermocomp
