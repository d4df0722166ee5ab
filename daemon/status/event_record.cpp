#include "daemon/status/event_record.hpp"

#include <cmath>
#include <cstdint>

namespace thermocomp {

RecordedEvent recorded(const Event& event) {
  RecordedEvent kept;
  kept.number = static_cast<std::int64_t>(event.number);
  kept.wall_ns = event.wall_ns;
  kept.kind = event.kind;
  kept.subject = event.subject;
  kept.what = event.what;
  if (std::isfinite(event.duration_s))
    kept.duration_ns = static_cast<std::int64_t>(std::llround(1e9 * event.duration_s));
  kept.user = event.user;
  return kept;
}

}  // namespace thermocomp
