#include "daemon/history/history_reader.hpp"

#include <cstdlib>
#include <optional>
#include <utility>

#include "daemon/history/chunk_codec.hpp"
#include "daemon/history/database.hpp"

namespace thermocomp {
namespace {

SegmentReason reason_from(std::int64_t code) {
  if (code < 0 || code > static_cast<std::int64_t>(SegmentReason::gap)) {
    throw HistoryError("damaged: unknown reason of a segment");
  }
  return static_cast<SegmentReason>(code);
}

/// What no history can be: without these limits the arithmetic of times would overflow, and a
/// replay would never end.
constexpr std::int64_t grid_ns_max = std::int64_t{1} << 60;  ///< 36 years since the system started
constexpr std::int64_t span_ns_max = std::int64_t{1} << 55;  ///< a year; segments last a week
constexpr std::int64_t wall_ns_max = std::int64_t{1} << 62;  ///< in the year 2116
constexpr std::int64_t period_ns_min = 100'000;
constexpr std::int64_t period_ns_max = 3'600'000'000'000;

void require(bool holds, const char* damage) {
  if (!holds) throw HistoryError(std::string("damaged: ") + damage);
}

void check_times(const SegmentInfo& segment) {
  const std::int64_t period_ns = segment.grid.period.count();
  const std::int64_t start_ns = segment.grid.start.count();
  const auto first = static_cast<std::int64_t>(segment.first_cycle);
  require(period_ns >= period_ns_min && period_ns <= period_ns_max, "a period that cannot be");
  require(start_ns >= 0 && start_ns <= grid_ns_max, "the start of a grid that cannot be");
  require(segment.wall_ns >= 0 && segment.wall_ns <= wall_ns_max, "a wall time that cannot be");
  require(first >= 0 && first <= (grid_ns_max - start_ns) / period_ns, "a cycle that cannot be");
  require(segment.last_cycle >= first - 1 && segment.last_cycle - first < span_ns_max / period_ns,
          "a segment's last cycle cannot be");
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

void check_is_history(Database& database) {
  const std::string name = database.file().string();
  if (database.number("PRAGMA application_id") != history_application_id) {
    throw HistoryError(name + ": is not a history of thermocomp");
  }
  const std::int64_t version = database.number("PRAGMA user_version");
  if (version > history_version) {
    throw HistoryError(name + ": is of version " + std::to_string(version) +
                       ", this program reads up to version " + std::to_string(history_version));
  }
}

}  // namespace

struct HistoryReader::Parts {
  explicit Parts(const std::filesystem::path& path)
      : file(path), database(path, DatabaseMode::read_only) {}
  std::filesystem::path file;
  mutable Database database;
  std::vector<SegmentInfo> segments;
};

HistoryReader::HistoryReader(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) throw HistoryError(file.string() + ": there is no such file");
  parts_ = std::make_unique<Parts>(file);
  check_is_history(parts_->database);
  Statement rows(parts_->database,
                 "SELECT id, run, setup, reason, grid_start_ns, period_ns, first_cycle, last_cycle,"
                 " wall_ns, records, bytes, program_version FROM segment ORDER BY id");
  while (rows.step()) {
    try {
      parts_->segments.push_back(segment_from(rows));
    } catch (const DatabaseError&) {
      throw;  // names the file
    } catch (const HistoryError& error) {
      throw HistoryError(file.string() + ": " + error.what());
    }
  }
}

HistoryReader::~HistoryReader() = default;
HistoryReader::HistoryReader(HistoryReader&&) noexcept = default;

const std::filesystem::path& HistoryReader::file() const noexcept {
  return parts_->file;
}
const std::vector<SegmentInfo>& HistoryReader::segments() const noexcept {
  return parts_->segments;
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
  // Told before anything is replayed: a far cycle that a damaged record names would be reached
  // first.
  Statement newest(
      parts_->database,
      "SELECT through_cycle FROM chunk WHERE segment = ? ORDER BY number DESC LIMIT 1");
  newest.bind(segment.id);
  if (segment.last_cycle >= static_cast<std::int64_t>(segment.first_cycle) &&
      !(newest.step() && newest.number(0) >= segment.last_cycle)) {
    throw HistoryError(parts_->file.string() + ": the chunks of segment " +
                       std::to_string(segment.id) +
                       " end before its last cycle (damaged, or deleted meanwhile)");
  }
  return RecordCursor(*this, segment);
}

struct RecordCursor::Parts {
  Parts(Database& database_in, SegmentInfo segment_in)
      : database(database_in), segment(std::move(segment_in)) {}
  Database& database;
  SegmentInfo segment;
  std::int64_t next_chunk{0};
  std::int64_t through{-1};  ///< last cycle that the chunks read so far hold whole
  std::int64_t wall_minus_grid_ns{0};
  std::uint64_t newest_cycle{0};  ///< of the records so far
  bool has_offsets{false};        ///< the newest record is an offset of that cycle
  std::optional<ChunkDecoder> chunk;
};

RecordCursor::RecordCursor(const HistoryReader& reader, const SegmentInfo& segment)
    : parts_(std::make_unique<Parts>(reader.parts_->database, segment)) {
  parts_->wall_minus_grid_ns = segment.wall_ns - segment.grid.time_of(segment.first_cycle).count();
  parts_->through = static_cast<std::int64_t>(segment.first_cycle) - 1;
  parts_->newest_cycle = segment.first_cycle;
}
RecordCursor::~RecordCursor() = default;
RecordCursor::RecordCursor(RecordCursor&&) noexcept = default;

std::int64_t RecordCursor::wall_minus_grid_ns() const noexcept {
  return parts_->wall_minus_grid_ns;
}

bool RecordCursor::next(Record& out) {
  Parts& parts = *parts_;
  for (;;) {
    if (parts.chunk && parts.chunk->next(out)) {
      // Within a cycle the offsets, which come out of its step, are the last.
      const bool is_late =
          out.cycle == parts.newest_cycle && parts.has_offsets && out.kind != RecordKind::offset;
      require(out.cycle >= parts.newest_cycle && !is_late, "records are out of order");
      parts.newest_cycle = out.cycle;
      parts.has_offsets = out.kind == RecordKind::offset;
      // What follows the last cycle was cut off before its cycle was whole.
      return out.cycle < static_cast<std::uint64_t>(parts.segment.last_cycle + 1);
    }
    parts.chunk.reset();
    // A statement of its own for each chunk: a read transaction that stays open would keep the
    // daemon's write-ahead log from being taken back.
    Statement row(parts.database,
                  "SELECT records, count, through_cycle, wall_minus_grid_ns FROM chunk"
                  " WHERE segment = ? AND number = ?");
    row.bind(parts.segment.id).bind(parts.next_chunk);
    if (!row.step()) {
      if (parts.through >= parts.segment.last_cycle) return false;
      throw HistoryError(parts.database.file().string() + ": chunk " +
                         std::to_string(parts.next_chunk) + " of segment " +
                         std::to_string(parts.segment.id) +
                         " is missing (damaged, or deleted meanwhile)");
    }
    ++parts.next_chunk;
    parts.through = row.number(2);
    parts.wall_minus_grid_ns = row.number(3);
    require(std::abs(parts.wall_minus_grid_ns / 2) <= wall_ns_max / 2,
            "a wall time that cannot be");
    parts.chunk.emplace(row.blob(0), static_cast<std::uint64_t>(row.number(1)));
  }
}

}  // namespace thermocomp
