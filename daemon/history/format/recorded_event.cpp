#include "daemon/history/format/recorded_event.hpp"

#include <string>

#include "status/status_json.hpp"

namespace thermocomp {
namespace {

/// An earlier version kept only texts.
Event event_of_texts(const Statement& row) {
  Event event;
  event.kind = event_kind_named(row.text(3));
  event.subject.name = row.text(4);
  (event.kind == EventKind::mode ? event.code : event.detail) = row.text(5);
  if (row.number(6) >= 0) event.duration_s = 1e-9 * static_cast<double>(row.number(6));
  event.user = row.number(7);
  return event;
}

RecordedEvent event_from(const Statement& row) {
  const std::string record = row.text(8);
  RecordedEvent event;
  static_cast<Event&>(event) =
      record.empty() ? event_of_texts(row)
                     : part_from<Event>(nlohmann::json::parse(record, nullptr, false));
  event.run = row.number(0);
  event.number = static_cast<std::uint64_t>(row.number(1));
  event.wall_s = 1e-9 * static_cast<double>(row.number(2));
  return event;
}

std::string query_of_events(Database& database, const std::string& condition) {
  return std::string("SELECT run, number, wall_ns, kind, subject, what, duration_ns, user, ") +
         (has_event_records(database) ? "record" : "''") + " FROM event" + condition +
         " ORDER BY run, number";
}

}  // namespace

bool has_event_records(Database& database) {
  return database.number("SELECT count(*) FROM pragma_table_info('event') WHERE name = 'record'") !=
         0;
}

std::vector<RecordedEvent> read_events(const std::filesystem::path& history,
                                       const std::optional<HistoryTime>& from,
                                       const std::optional<HistoryTime>& to) {
  Database database(history, DatabaseMode::read_only);
  require_history(database);
  const std::string query = query_of_events(database, "");
  std::vector<RecordedEvent> events;
  Statement rows(database, query.c_str());
  std::optional<std::int64_t> first_ns;
  while (rows.step()) {
    const std::int64_t wall_ns = rows.number(2);
    if (!first_ns) first_ns = wall_ns;
    const double since_first_s = 1e-9 * static_cast<double>(wall_ns - *first_ns);
    if (from && is_before(since_first_s, wall_ns, *from)) continue;
    if (to && !is_before(since_first_s, wall_ns, *to)) continue;
    events.push_back(event_from(rows));
  }
  return events;
}

std::vector<RecordedEvent> read_events_after(const std::filesystem::path& history, std::int64_t run,
                                             std::uint64_t number, std::int64_t count) {
  Database database(history, DatabaseMode::read_only);
  require_history(database);
  const std::string query = query_of_events(database, " WHERE (run, number) > (?, ?)") + " LIMIT ?";
  Statement rows(database, query.c_str());
  rows.bind(run).bind(static_cast<std::int64_t>(number)).bind(count);
  std::vector<RecordedEvent> events;
  while (rows.step()) events.push_back(event_from(rows));
  return events;
}

}  // namespace thermocomp
