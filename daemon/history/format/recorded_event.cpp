#include "daemon/history/format/recorded_event.hpp"

#include "daemon/history/format/database.hpp"

namespace thermocomp {
namespace {

RecordedEvent event_from(const Statement& row) {
  RecordedEvent event;
  event.run = row.number(0);
  event.number = row.number(1);
  event.wall_ns = row.number(2);
  event.kind = row.text(3);
  event.subject = row.text(4);
  event.what = row.text(5);
  event.duration_ns = row.number(6);
  event.user = row.number(7);
  return event;
}

bool is_before(std::int64_t wall_ns, std::int64_t first_ns, const HistoryTime& bound) {
  return bound.seconds ? 1e-9 * static_cast<double>(wall_ns - first_ns) < *bound.seconds
                       : wall_ns < *bound.wall_ns;
}

}  // namespace

RecordedEvents read_events(const std::filesystem::path& history,
                           const std::optional<HistoryTime>& from,
                           const std::optional<HistoryTime>& to) {
  Database database(history, DatabaseMode::read_only);
  require_history(database);
  RecordedEvents found;
  found.are_kept =
      database.number(
          "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = 'event'") != 0;
  if (!found.are_kept) return found;
  Statement rows(database,
                 "SELECT run, number, wall_ns, kind, subject, what, duration_ns, user FROM event"
                 " ORDER BY run, number");
  std::optional<std::int64_t> first_ns;
  while (rows.step()) {
    RecordedEvent event = event_from(rows);
    if (!first_ns) first_ns = event.wall_ns;
    if (from && is_before(event.wall_ns, *first_ns, *from)) continue;
    if (to && !is_before(event.wall_ns, *first_ns, *to)) continue;
    found.events.push_back(std::move(event));
  }
  return found;
}

}  // namespace thermocomp
