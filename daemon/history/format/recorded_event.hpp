/// What happened, for every run of the daemon that a history still has.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "daemon/history/format/database.hpp"
#include "daemon/history/format/history_time.hpp"
#include "status/event.hpp"

namespace thermocomp {

struct RecordedEvents {
  std::vector<RecordedEvent> events;  ///< oldest first
  bool are_kept{false};  ///< false: an earlier version wrote the history, which kept no events
};

/// Whether the table `event` keeps whole records, or only their texts as an earlier version did.
[[nodiscard]] bool has_event_records(Database& database);

/// Times of `from` and `to` are wall times; seconds count from the first event.
/// @throws HistoryError: no history, or one that cannot be read
[[nodiscard]] RecordedEvents read_events(const std::filesystem::path& history,
                                         const std::optional<HistoryTime>& from = {},
                                         const std::optional<HistoryTime>& to = {});

}  // namespace thermocomp
