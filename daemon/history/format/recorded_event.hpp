/// What happened, as the history keeps it, for every run of the daemon that is still in the file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/history/format/history_time.hpp"

namespace thermocomp {

/// The fields mean what they do in daemon/status/event_journal.hpp.
struct RecordedEvent {
  std::int64_t run{0};  ///< one number for each start of the daemon; set by the history
  std::int64_t number{0};
  std::int64_t wall_ns{0};
  std::string kind;
  std::string subject;
  std::string what;
  std::int64_t duration_ns{-1};  ///< -1: none
  std::int64_t user{-1};
};

struct RecordedEvents {
  std::vector<RecordedEvent> events;  ///< oldest first
  bool are_kept{false};  ///< false: an earlier version wrote the history, which kept no events
};

/// Times of `from` and `to` are wall times; seconds count from the first event.
/// @throws HistoryError: no history, or one that cannot be read
[[nodiscard]] RecordedEvents read_events(const std::filesystem::path& history,
                                         const std::optional<HistoryTime>& from = {},
                                         const std::optional<HistoryTime>& to = {});

}  // namespace thermocomp
