#include "daemon/history/reading/history_reader.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>
#include <system_error>

#include "daemon/history/format/chunk_codec.hpp"
#include "daemon/history/format/database.hpp"
#include "daemon/history/format/segments.hpp"
#include "status/status.hpp"

namespace thermocomp {
namespace {

/// Earlier versions stored only texts.
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

/// Wall time of each run's last record.
std::map<std::int64_t, double> run_ends_s(Database& database) {
  Statement rows(database, "SELECT run, max(last_wall_ns) FROM segment GROUP BY run");
  std::map<std::int64_t, double> ends_s;
  while (rows.step()) ends_s[rows.number(0)] = 1e-9 * static_cast<double>(rows.number(1));
  return ends_s;
}

/// A run that was stopped ends with that event, any other with its last record.
void note_absences(std::vector<RecordedEvent>& events, Database& database) {
  const std::map<std::int64_t, double> ends_s = run_ends_s(database);
  for (std::size_t i = 1; i < events.size(); ++i) {
    RecordedEvent& event = events[i];
    const RecordedEvent& before = events[i - 1];
    if (event.kind != EventKind::daemon || event.code != "started" || event.run == before.run)
      continue;
    const auto recorded = ends_s.find(before.run);
    const bool is_known = before.code == "stopping" || recorded != ends_s.end();
    double end_s = before.wall_s;
    if (recorded != ends_s.end()) end_s = std::max(end_s, recorded->second);
    if (is_known) event.duration_s = std::max(0.0, event.wall_s - end_s);
  }
}

SegmentReason reason_from(std::int64_t code) {
  require_sound(code >= 0 && code <= static_cast<std::int64_t>(SegmentReason::gap),
                "unknown reason of a segment");
  return static_cast<SegmentReason>(code);
}

SegmentInfo segment_from(const Statement& row) {
  SegmentInfo segment;
  segment.id = row.number(0);
  segment.run = row.number(1);
  segment.setup = row.number(2);
  segment.reason = reason_from(row.number(3));
  segment.grid.start = nanoseconds(row.number(4));
  segment.grid.period = nanoseconds(row.number(5));
  segment.first_cycle = static_cast<std::uint64_t>(row.number(6));
  segment.last_cycle = row.number(7);
  segment.wall_ns = row.number(8);
  segment.records = static_cast<std::uint64_t>(row.number(9));
  segment.bytes = static_cast<std::uint64_t>(row.number(10));
  segment.program_version = row.text(11);
  check_times(segment);
  return segment;
}

constexpr const char* columns_of_segment =
    "SELECT id, run, setup, reason, grid_start_ns, period_ns, first_cycle, last_cycle,"
    " wall_ns, records, bytes, program_version FROM segment";

/// Limits the last cycle to the chunks, beyond which a replay would continue with old inputs.
void limit_to_chunks(Database& database, SegmentInfo& segment, std::vector<HistoryDamage>& damage) {
  const std::int64_t none = static_cast<std::int64_t>(segment.first_cycle) - 1;
  if (segment.last_cycle == none) return;
  const std::int64_t newest = database.number(
      "SELECT max(through_cycle) FROM"
      " (SELECT through_cycle FROM chunk WHERE segment = ? ORDER BY number DESC LIMIT 2)",
      segment.id);
  const std::int64_t through = std::max(newest, none);
  if (through >= segment.last_cycle) return;
  segment.last_cycle = through;
  damage.push_back({segment.id, "its chunks end before its last cycle"});
}

/// Reads rows in that order up to a known one. @throws DatabaseError
void read_segments(Database& database, const char* order, std::vector<SegmentInfo>& found,
                   std::vector<HistoryDamage>& damage) {
  Statement rows(database, (std::string(columns_of_segment) + order).c_str());
  while (rows.step()) {
    const std::int64_t id = rows.number(0);
    const bool is_known =
        std::any_of(found.begin(), found.end(), [id](const auto& each) { return each.id == id; }) ||
        std::any_of(damage.begin(), damage.end(),
                    [id](const auto& each) { return each.segment == id; });
    if (is_known) return;
    try {
      found.push_back(segment_from(rows));
      limit_to_chunks(database, found.back(), damage);
    } catch (const DatabaseError&) {
      throw;
    } catch (const HistoryError& error) {
      damage.push_back({id, error.what()});
    }
  }
}

}  // namespace

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
    if (is_within(since_first_s, wall_ns, from, to)) events.push_back(event_from(rows));
  }
  note_absences(events, database);
  return events;
}

std::vector<RecordedEvent> read_events_after(const std::filesystem::path& history, std::int64_t run,
                                             std::uint64_t number, std::int64_t count) {
  Database database(history, DatabaseMode::read_only);
  require_history(database);
  const std::string query = query_of_events(database, " WHERE (run, number) > (?, ?)") + " LIMIT ?";
  Statement rows(database, query.c_str(), run, static_cast<std::int64_t>(number), count);
  std::vector<RecordedEvent> events;
  while (rows.step()) events.push_back(event_from(rows));
  return events;
}

HistoryReader::HistoryReader(const std::filesystem::path& file) : file_(file) {
  std::error_code failed;
  if (!std::filesystem::exists(file, failed)) {
    throw HistoryError(file.string() + ": " +
                       (failed ? failed.message() : std::string("there is no such file")));
  }
  database_ = std::make_shared<Database>(file, DatabaseMode::read_only);
  require_history(*database_);
  database_->run("PRAGMA cache_size = -256");  // chunks are read once, sequentially
  std::vector<SegmentInfo> found;
  try {
    read_segments(*database_, " ORDER BY id", found, damage_);
  } catch (const DatabaseError& error) {
    // A page of the table is damaged: the rows after it are read from the other end.
    damage_.push_back({0, std::string("some segments cannot be read: ") + error.what()});
    try {
      read_segments(*database_, " ORDER BY id DESC", found, damage_);
    } catch (const DatabaseError&) {  // reported already
    }
    if (found.empty()) throw;
  }
  std::sort(found.begin(), found.end(),
            [](const SegmentInfo& a, const SegmentInfo& b) { return a.id < b.id; });
  segments_ = sound_segments(std::move(found), places_, damage_);
}

SegmentSetup HistoryReader::setup(const SegmentInfo& segment) const {
  Statement row(*database_,
                "SELECT config_text, model_text, model_checksum FROM setup WHERE id = ?",
                segment.setup);
  if (!row.step()) {
    throw HistoryError(file_.string() + ": the configuration of segment " +
                       std::to_string(segment.id) + " is missing");
  }
  return {row.text(0), row.text(1), row.text(2)};
}

SegmentStart HistoryReader::start(const SegmentInfo& segment) const {
  check_segment_row(*database_, segment.id);
  Statement row(*database_, "SELECT estimator_state, inputs FROM segment WHERE id = ?", segment.id);
  if (!row.step()) {
    throw HistoryError(file_.string() + ": segment " + std::to_string(segment.id) +
                       " was deleted meanwhile");
  }
  SegmentStart start;
  start.estimator_state = row.blob(0);
  take_seal(start.estimator_state);
  decode_inputs(row.blob(1), start.readings, start.controller);
  return start;
}

RecordCursor::RecordCursor(const HistoryReader& reader, SegmentInfo segment)
    : database_(reader.database_),
      segment_(std::move(segment)),
      through_(static_cast<std::int64_t>(segment_.first_cycle) - 1),
      wall_minus_grid_ns_(segment_.wall_ns - segment_.grid.time_of(segment_.first_cycle).count()),
      order_(segment_.first_cycle) {}

/// Decodes the whole chunk before any record is returned.
void RecordCursor::decode(std::vector<std::byte> bytes, std::uint64_t count) {
  require_sound(count <= bytes.size(), "more records than bytes");
  std::vector<Record> decoded;
  decoded.reserve(count);
  ChunkDecoder chunk(std::move(bytes), count);
  RecordOrder order_then = order_;
  for (Record record; chunk.next(record); decoded.push_back(record))
    require_sound(order_then.admits(record), "records are out of order");
  order_ = order_then;
  records_ = std::move(decoded);
  given_ = 0;
}

/// @return false after the segment's last chunk
bool RecordCursor::load_chunk() {
  // One statement per chunk: a read transaction kept open would block the checkpoint of the
  // daemon's write-ahead log.
  std::optional<ChunkContent> content = read_chunk(*database_, segment_.id, next_chunk_);
  const std::string chunk = "chunk " + std::to_string(next_chunk_);
  if (!content) {
    if (through_ >= segment_.last_cycle) return false;
    throw HistoryError(chunk + " is missing (damaged, or deleted meanwhile)");
  }
  try {
    decode(std::move(content->records), static_cast<std::uint64_t>(content->count));
  } catch (const HistoryError& error) {
    throw HistoryError(chunk + ": " + error.what());
  }
  ++next_chunk_;
  through_ = content->through_cycle;
  const std::int64_t begin_ns = segment_.grid.time_of(segment_.first_cycle).count();
  const std::int64_t difference_ns = content->wall_minus_grid_ns;
  if (difference_ns >= -grid_ns_max && difference_ns <= wall_ns_max - begin_ns) {
    wall_minus_grid_ns_ = difference_ns;
  } else {
    wall_was_impossible_ = true;
  }
  return true;
}

bool RecordCursor::next(Record& out) {
  while (given_ == records_.size()) {
    if (!load_chunk()) return false;
  }
  out = records_[given_];
  // Records after the last complete cycle belong to an incomplete one.
  const bool is_whole = out.cycle < static_cast<std::uint64_t>(segment_.last_cycle + 1);
  if (is_whole) ++given_;
  return is_whole;
}

void RecordCursor::extend(std::int64_t last_cycle) {
  segment_.last_cycle = std::max(segment_.last_cycle, last_cycle);
}

bool RecordCursor::resume() {
  records_.clear();
  given_ = 0;
  try {
    Statement row(*database_,
                  "SELECT number FROM chunk WHERE segment = ? AND number > ?"
                  " ORDER BY number LIMIT 1",
                  segment_.id, next_chunk_);
    if (!row.step()) return false;
    next_chunk_ = row.number(0);
    return true;
  } catch (const DatabaseError&) {
    return false;  // the index itself is damaged
  }
}

}  // namespace thermocomp
