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
    if (from && is_before(since_first_s, wall_ns, *from)) continue;
    if (to && !is_before(since_first_s, wall_ns, *to)) continue;
    events.push_back(event_from(rows));
  }
  note_absences(events, database);
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

namespace {

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

}  // namespace

struct HistoryReader::Parts {
  explicit Parts(const std::filesystem::path& path)
      : file(path), database(path, DatabaseMode::read_only) {}

  void read(const char* order, std::vector<SegmentInfo>& found);
  void limit_to_chunks(SegmentInfo& segment);
  [[nodiscard]] bool contains(std::int64_t id, const std::vector<SegmentInfo>& found) const;

  std::filesystem::path file;
  mutable Database database;
  std::vector<SegmentInfo> segments;
  std::vector<HistoryDamage> damage;
};

bool HistoryReader::Parts::contains(std::int64_t id, const std::vector<SegmentInfo>& found) const {
  return std::any_of(found.begin(), found.end(),
                     [id](const SegmentInfo& segment) { return segment.id == id; }) ||
         std::any_of(damage.begin(), damage.end(),
                     [id](const HistoryDamage& part) { return part.segment == id; });
}

/// Reads rows in that order up to a known one. @throws DatabaseError
void HistoryReader::Parts::read(const char* order, std::vector<SegmentInfo>& found) {
  Statement rows(database, (std::string(columns_of_segment) + order).c_str());
  while (rows.step()) {
    const std::int64_t id = rows.number(0);
    if (contains(id, found)) return;
    try {
      found.push_back(segment_from(rows));
      limit_to_chunks(found.back());
    } catch (const DatabaseError&) {
      throw;
    } catch (const HistoryError& error) {
      damage.push_back({id, error.what()});
    }
  }
}

/// Limits the last cycle to the chunks, beyond which a replay would continue with old inputs.
void HistoryReader::Parts::limit_to_chunks(SegmentInfo& segment) {
  const std::int64_t none = static_cast<std::int64_t>(segment.first_cycle) - 1;
  if (segment.last_cycle == none) return;
  Statement newest(database,
                   "SELECT max(through_cycle) FROM"
                   " (SELECT through_cycle FROM chunk WHERE segment = ? ORDER BY number DESC"
                   " LIMIT 2)");
  newest.bind(segment.id);
  const std::int64_t through = newest.step() ? std::max(newest.number(0), none) : none;
  if (through >= segment.last_cycle) return;
  segment.last_cycle = through;
  damage.push_back({segment.id, "its chunks end before its last cycle"});
}

HistoryReader::HistoryReader(const std::filesystem::path& file) {
  std::error_code failed;
  if (!std::filesystem::exists(file, failed)) {
    throw HistoryError(file.string() + ": " +
                       (failed ? failed.message() : std::string("there is no such file")));
  }
  parts_ = std::make_unique<Parts>(file);
  require_history(parts_->database);
  parts_->database.run("PRAGMA cache_size = -256");  // chunks are read once, sequentially
  std::vector<SegmentInfo> found;
  try {
    parts_->read(" ORDER BY id", found);
  } catch (const DatabaseError& error) {
    // A page of the table is damaged: the rows after it are read from the other end.
    parts_->damage.push_back({0, std::string("some segments cannot be read: ") + error.what()});
    try {
      parts_->read(" ORDER BY id DESC", found);
    } catch (const DatabaseError&) {  // reported already
    }
    if (found.empty()) throw;
  }
  std::sort(found.begin(), found.end(),
            [](const SegmentInfo& a, const SegmentInfo& b) { return a.id < b.id; });
  parts_->segments = sound_segments(std::move(found), parts_->damage);
}

HistoryReader::~HistoryReader() = default;
HistoryReader::HistoryReader(HistoryReader&&) noexcept = default;

const std::filesystem::path& HistoryReader::file() const noexcept {
  return parts_->file;
}
const std::vector<SegmentInfo>& HistoryReader::segments() const& noexcept {
  return parts_->segments;
}
const std::vector<HistoryDamage>& HistoryReader::damage() const noexcept {
  return parts_->damage;
}

SegmentSetup HistoryReader::setup(const SegmentInfo& segment) const {
  Statement row(parts_->database,
                "SELECT config_text, model_text, model_checksum FROM setup WHERE id = ?");
  row.bind(segment.setup);
  if (!row.step()) {
    throw HistoryError(parts_->file.string() + ": the configuration of segment " +
                       std::to_string(segment.id) + " is missing");
  }
  return {row.text(0), row.text(1), row.text(2)};
}

SegmentStart HistoryReader::start(const SegmentInfo& segment) const {
  check_segment_row(parts_->database, segment.id);
  Statement row(parts_->database, "SELECT estimator_state, inputs FROM segment WHERE id = ?");
  row.bind(segment.id);
  if (!row.step()) {
    throw HistoryError(parts_->file.string() + ": segment " + std::to_string(segment.id) +
                       " was deleted meanwhile");
  }
  SegmentStart start;
  start.estimator_state = row.blob(0);
  take_seal(start.estimator_state);
  decode_inputs(row.blob(1), start.readings, start.controller);
  return start;
}

RecordCursor HistoryReader::records(const SegmentInfo& segment) const {
  return RecordCursor(*this, segment);
}

struct RecordCursor::Parts {
  Parts(Database& database_in, SegmentInfo segment_in)
      : database(database_in), segment(std::move(segment_in)) {}
  void decode(std::vector<std::byte> bytes, std::uint64_t count);

  Database& database;
  SegmentInfo segment;
  std::int64_t next_chunk{0};
  std::int64_t through{-1};  ///< last complete cycle of the chunks read so far
  std::int64_t wall_minus_grid_ns{0};
  bool wall_was_impossible{false};
  RecordOrder order;            ///< of the chunks so far
  std::vector<Record> records;  ///< of the present chunk
  std::size_t given{0};         ///< number of records returned
};

RecordCursor::RecordCursor(const HistoryReader& reader, const SegmentInfo& segment)
    : parts_(std::make_unique<Parts>(reader.parts_->database, segment)) {
  parts_->wall_minus_grid_ns = segment.wall_ns - segment.grid.time_of(segment.first_cycle).count();
  parts_->through = static_cast<std::int64_t>(segment.first_cycle) - 1;
  parts_->order = RecordOrder(segment.first_cycle);
}
RecordCursor::~RecordCursor() = default;
RecordCursor::RecordCursor(RecordCursor&&) noexcept = default;

std::int64_t RecordCursor::wall_minus_grid_ns() const noexcept {
  return parts_->wall_minus_grid_ns;
}

bool RecordCursor::wall_time_was_impossible() const noexcept {
  return parts_->wall_was_impossible;
}

/// Decodes the whole chunk before any record is returned.
void RecordCursor::Parts::decode(std::vector<std::byte> bytes, std::uint64_t count) {
  if (count > bytes.size()) throw HistoryError("damaged: more records than bytes");
  std::vector<Record> decoded;
  decoded.reserve(count);
  ChunkDecoder chunk(std::move(bytes), count);
  RecordOrder order_then = order;
  for (Record record; chunk.next(record); decoded.push_back(record))
    require_sound(order_then.admits(record), "records are out of order");
  order = order_then;
  records = std::move(decoded);
  given = 0;
}

/// @return false after the segment's last chunk
bool RecordCursor::load_chunk() {
  Parts& parts = *parts_;
  // One statement per chunk: a read transaction kept open would block the checkpoint of the
  // daemon's write-ahead log.
  std::optional<ChunkContent> content =
      read_chunk(parts.database, parts.segment.id, parts.next_chunk);
  const std::string chunk = "chunk " + std::to_string(parts.next_chunk);
  if (!content) {
    if (parts.through >= parts.segment.last_cycle) return false;
    throw HistoryError(chunk + " is missing (damaged, or deleted meanwhile)");
  }
  const ChunkNumbers& numbers = content->numbers;
  try {
    parts.decode(std::move(content->records), static_cast<std::uint64_t>(numbers.count));
  } catch (const HistoryError& error) {
    throw HistoryError(chunk + ": " + error.what());
  }
  ++parts.next_chunk;
  parts.through = numbers.through_cycle;
  const std::int64_t begin_ns = parts.segment.grid.time_of(parts.segment.first_cycle).count();
  const std::int64_t difference_ns = numbers.wall_minus_grid_ns;
  if (difference_ns >= -grid_ns_max && difference_ns <= wall_ns_max - begin_ns) {
    parts.wall_minus_grid_ns = difference_ns;
  } else {
    parts.wall_was_impossible = true;
  }
  return true;
}

bool RecordCursor::next(Record& out) {
  Parts& parts = *parts_;
  while (parts.given == parts.records.size()) {
    if (!load_chunk()) return false;
  }
  out = parts.records[parts.given];
  // Records after the last complete cycle belong to an incomplete one.
  const bool is_whole = out.cycle < static_cast<std::uint64_t>(parts.segment.last_cycle + 1);
  if (is_whole) ++parts.given;
  return is_whole;
}

void RecordCursor::extend(std::int64_t last_cycle) {
  parts_->segment.last_cycle = std::max(parts_->segment.last_cycle, last_cycle);
}

bool RecordCursor::resume() {
  Parts& parts = *parts_;
  parts.records.clear();
  parts.given = 0;
  try {
    Statement row(parts.database,
                  "SELECT number FROM chunk WHERE segment = ? AND number > ?"
                  " ORDER BY number LIMIT 1");
    row.bind(parts.segment.id).bind(parts.next_chunk);
    if (!row.step()) return false;
    parts.next_chunk = row.number(0);
    return true;
  } catch (const DatabaseError&) {
    return false;  // the index itself is damaged
  }
}

}  // namespace thermocomp
