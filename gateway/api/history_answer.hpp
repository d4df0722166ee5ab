/// Answer to /api/history.
#pragma once

#include "gateway/feed/daemon_feed.hpp"
#include "gateway/http/answer_thread.hpp"
#include "gateway/http/request_rules.hpp"

namespace thermocomp::gateway {

/// {"from_s", "recorded_since_s", "to_s", "span_s", "columns": {"time_s": [...], "bed_degC": [...],
/// "z_offset_um": [...]}, "probings": [{"axis", "time_s", "left_um", "needed_um"}], "modes":
/// [{"mode", "from_s", "to_s"}], "events": [{"time_s", "text"}], "chunks", "chunks_read", "damage":
/// [...]}; null: unknown. `modes` are the intervals without compensation.
[[nodiscard]] JsonAnswer history_answer(const DaemonFeed& feed, const HistoryRequest& request);

}  // namespace thermocomp::gateway
