/// What happened, for every run of the daemon that a history still has.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "daemon/history/format/database.hpp"
#include "daemon/history/format/history_time.hpp"
#include "status/event.hpp"

namespace thermocomp {

/// Whether the table `event` keeps whole records, or only their texts as version 0.1.0 did.
[[nodiscard]] bool has_event_records(Database& database);

/// The events, oldest first. Times of `from` and `to` are wall times; seconds count from the first
/// event.
/// @throws HistoryError: no history, or one that cannot be read
[[nodiscard]] std::vector<RecordedEvent> read_events(const std::filesystem::path& history,
                                                     const std::optional<HistoryTime>& from = {},
                                                     const std::optional<HistoryTime>& to = {});

/// The events after that of `run` and `number`, by run and number, `count` at most.
/// @throws HistoryError: no history, or one that cannot be read
[[nodiscard]] std::vector<RecordedEvent> read_events_after(const std::filesystem::path& history,
                                                           std::int64_t run, std::uint64_t number,
                                                           std::int64_t count);

}  // namespace thermocomp
