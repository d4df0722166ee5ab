/// An event of the running daemon as its history keeps it.
#pragma once

#include "daemon/history/format/recorded_event.hpp"
#include "daemon/status/event_journal.hpp"

namespace thermocomp {

/// Its `run` is left to the history.
[[nodiscard]] RecordedEvent recorded(const Event& event);

}  // namespace thermocomp
