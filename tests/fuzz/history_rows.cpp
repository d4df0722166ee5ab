/// A history that is valid SQLite with rows that no daemon wrote, made from a good one by SQL. Any
/// unchanged segment is read completely.
#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include <sqlite3.h>

#include "common/fuzz.hpp"
#include "common/history_properties.hpp"
#include "common/recorded_history.hpp"
#include "daemon/history/format/chunk_codec.hpp"
#include "daemon/history/reading/history_reader.hpp"
#include "daemon/history/replay/replay.hpp"

using namespace thermocomp;

namespace {

constexpr std::array segment_columns{
    "id",        "run",         "setup",      "reason",  "grid_start_ns",
    "period_ns", "first_cycle", "last_cycle", "wall_ns", "records"};
constexpr std::array chunk_columns{"segment", "number", "through_cycle", "wall_minus_grid_ns",
                                   "count"};
constexpr int edits_max = 8;
/// Damage of rows, of types and of the file's metadata.
constexpr std::array statements{
    "DELETE FROM chunk WHERE number = 0",
    "DELETE FROM setup",
    "DELETE FROM chunk WHERE rowid % 2 = 0",
    "DELETE FROM segment WHERE id = 1",
    "UPDATE chunk SET count = 'many' WHERE rowid = 3",
    "UPDATE chunk SET records = NULL, count = NULL WHERE rowid = 3",
    "UPDATE OR IGNORE chunk SET records = 'text' WHERE rowid = 3",
    "UPDATE chunk SET checksum = NULL",
    "UPDATE segment SET checksum = NULL",
    "UPDATE chunk SET checksum = checksum + 1 WHERE rowid = 2",
    "UPDATE segment SET wall_ns = 9000000000000000000 WHERE id = 2",
    "UPDATE chunk SET wall_minus_grid_ns = 9000000000000000000",
    "UPDATE segment SET last_cycle = last_cycle + 10 WHERE id = 1",
    "UPDATE segment SET program_version = char(27) || '[2J' || char(8238)",
    "UPDATE setup SET config_text = substr(config_text, 1, 100)",
    "INSERT INTO segment SELECT id + 7, run, token, setup, reason, grid_start_ns, period_ns,"
    " first_cycle, last_cycle, wall_ns, last_wall_ns, records, bytes, program_version, inputs,"
    " estimator_state, checksum FROM segment",
    "INSERT INTO chunk SELECT id + 90, segment, number + 50, through_cycle, wall_minus_grid_ns,"
    " count, records, checksum FROM chunk",
    "PRAGMA user_version = 0",
    "PRAGMA user_version = -1",
    "PRAGMA user_version = 2147483647",
    "PRAGMA application_id = 0",
    "DROP INDEX chunk_of_segment",
    "ALTER TABLE chunk RENAME COLUMN checksum TO sum",
    "ALTER TABLE segment RENAME COLUMN wall_ns TO wall"};

/// Statements on the open copy; failing ones (such as an existing key) change nothing.
class Editor {
 public:
  explicit Editor(const std::filesystem::path& file) {
    FUZZ_REQUIRE(sqlite3_open(file.c_str(), &handle_) == SQLITE_OK);
    run("PRAGMA synchronous = OFF; PRAGMA journal_mode = MEMORY; BEGIN");
  }
  ~Editor() {
    run("COMMIT");
    sqlite3_close(handle_);
  }
  Editor(const Editor&) = delete;
  Editor& operator=(const Editor&) = delete;

  void run(const char* sql) { sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr); }

  void set_number(const std::string& table, const char* column, unsigned row, std::int64_t value) {
    set(table, column, row, [&](sqlite3_stmt* at) { sqlite3_bind_int64(at, 1, value); });
  }
  void set_blob(const std::string& table, const char* column, unsigned row,
                const std::vector<std::uint8_t>& bytes) {
    set(table, column, row, [&](sqlite3_stmt* at) {
      sqlite3_bind_blob(at, 1, bytes.empty() ? "" : static_cast<const void*>(bytes.data()),
                        static_cast<int>(bytes.size()), SQLITE_TRANSIENT);
    });
  }
  /// Overwrites bytes of a blob from `at` on.
  void splice(const std::string& table, const char* column, unsigned row, std::size_t at,
              const std::vector<std::uint8_t>& bytes) {
    std::vector<std::uint8_t> blob = get(table, column, row);
    if (blob.empty()) return;
    for (std::size_t i = 0; i < bytes.size(); ++i) blob[(at + i) % blob.size()] = bytes[i];
    set_blob(table, column, row, blob);
  }

 private:
  static std::string nth_row(const std::string& table, unsigned row) {
    return " WHERE rowid = (SELECT rowid FROM " + table + " ORDER BY rowid LIMIT 1 OFFSET " +
           std::to_string(row % 4) + ")";
  }
  template <class Bind>
  void set(const std::string& table, const char* column, unsigned row, Bind bind) {
    const std::string sql =
        "UPDATE OR IGNORE " + table + " SET " + column + " = ?" + nth_row(table, row);
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(handle_, sql.c_str(), -1, &statement, nullptr) == SQLITE_OK) {
      bind(statement);
      sqlite3_step(statement);
    }
    sqlite3_finalize(statement);
  }
  std::vector<std::uint8_t> get(const std::string& table, const char* column, unsigned row) {
    const std::string sql =
        std::string("SELECT ") + column + " FROM " + table + nth_row(table, row);
    std::vector<std::uint8_t> blob;
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(handle_, sql.c_str(), -1, &statement, nullptr) == SQLITE_OK &&
        sqlite3_step(statement) == SQLITE_ROW) {
      blob.resize(static_cast<std::size_t>(sqlite3_column_bytes(statement, 0)));
      if (!blob.empty()) std::memcpy(blob.data(), sqlite3_column_blob(statement, 0), blob.size());
    }
    sqlite3_finalize(statement);
    return blob;
  }

  sqlite3* handle_{nullptr};
};

/// Mostly small numbers, sometimes arbitrary ones.
std::int64_t number_from(fuzz::ByteFeed& feed) {
  const std::uint8_t kind = feed.u8();
  if (kind < 0xC0) return kind % 64 - 2;
  if (kind < 0xE0) return static_cast<std::int64_t>(feed.u16());
  return std::bit_cast<std::int64_t>(feed.u64());
}

/// Encoded records in an order and with numbers that no cycle produces.
std::vector<std::uint8_t> chunk_from(fuzz::ByteFeed& feed, std::uint64_t& count) {
  ChunkEncoder encoder;
  count = feed.u8() % 16;
  std::uint64_t cycle = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    Record record;
    record.kind = static_cast<RecordKind>(feed.u8() % record_kinds_count);
    cycle += static_cast<std::uint64_t>(number_from(feed));
    record.cycle = cycle;
    record.detail = feed.u8();
    record.index = static_cast<std::uint32_t>(number_from(feed));
    record.time_ns = number_from(feed);
    record.value = static_cast<double>(number_from(feed));
    encoder.add(record);
  }
  const std::vector<std::byte> bytes = encoder.take();
  const auto* first = reinterpret_cast<const std::uint8_t*>(bytes.data());
  return {first, first + bytes.size()};
}

void edit(Editor& editor, fuzz::ByteFeed& feed) {
  const std::uint8_t kind = feed.u8();
  const unsigned row = feed.u8();
  switch (kind % 7) {
    case 0:
      editor.set_number("segment", segment_columns[feed.u8() % segment_columns.size()], row,
                        number_from(feed));
      break;
    case 1:
      editor.set_number("chunk", chunk_columns[feed.u8() % chunk_columns.size()], row,
                        number_from(feed));
      break;
    case 2: {
      std::uint64_t count = 0;
      editor.set_blob("chunk", "records", row, chunk_from(feed, count));
      editor.set_number("chunk", "count", row, static_cast<std::int64_t>(count));
      break;
    }
    case 3: {
      const std::size_t at = feed.u16();
      editor.splice("chunk", "records", row, at, feed.take(1 + feed.u8() % 16));
      break;
    }
    case 4: {
      const std::size_t at = feed.u16();
      editor.splice("segment", "estimator_state", row, at, feed.take(1 + feed.u8() % 16));
      break;
    }
    case 5: {
      const std::size_t at = feed.u16();
      editor.splice("segment", "inputs", row, at, feed.take(1 + feed.u8() % 16));
      break;
    }
    case 6:
      editor.run(statements[row % statements.size()]);
      break;
  }
}

/// Setups of the good history are parsed once; others are refused like damaged ones.
ReplaySetup known_setup(const SegmentSetup& setup) {
  static const SegmentSetup known{fuzz::small_config_text(), fuzz::small_model_text(), ""};
  static const ReplaySetup parsed = parse_setup(known);
  if (setup.config_text == known.config_text && setup.model_text == known.model_text) return parsed;
  return parse_setup(setup);
}

/// All rows of each segment with its setup, as text.
std::vector<std::string> segments_as_text(const std::filesystem::path& file) {
  std::vector<std::string> found;
  sqlite3* handle = nullptr;
  sqlite3_stmt* rows = nullptr;
  const char* sql =
      "SELECT segment.id, quote(run) || quote(setup) || quote(reason) || quote(grid_start_ns)"
      " || quote(period_ns) || quote(first_cycle) || quote(last_cycle) || quote(wall_ns)"
      " || quote(inputs) || quote(estimator_state) || quote(segment.checksum)"
      " || quote(config_text) || quote(model_text)"
      " || quote(model_checksum) || quote(program_version),"
      " (SELECT group_concat(quote(number) || quote(through_cycle) || quote(count)"
      " || quote(wall_minus_grid_ns) || quote(records) || quote(checksum))"
      " FROM chunk WHERE chunk.segment = segment.id)"
      " FROM segment JOIN setup ON setup.id = segment.setup ORDER BY segment.id";
  if (sqlite3_open(file.c_str(), &handle) == SQLITE_OK &&
      sqlite3_prepare_v2(handle, sql, -1, &rows, nullptr) == SQLITE_OK) {
    while (sqlite3_step(rows) == SQLITE_ROW) {
      const auto text = [&](int column) {
        const unsigned char* bytes = sqlite3_column_text(rows, column);
        return bytes == nullptr ? std::string() : reinterpret_cast<const char*>(bytes);
      };
      found.push_back(text(0) + ":" + text(1) + "/" + text(2));
    }
  }
  sqlite3_finalize(rows);
  sqlite3_close(handle);
  return found;
}

/// An unchanged segment is sound to its last record, or a reason is given why it cannot be placed.
void check_untouched(const std::filesystem::path& file, const std::vector<std::uint8_t>& good) {
  struct Before {
    std::vector<std::string> texts;
    std::map<std::int64_t, std::uint64_t> records;
  };
  static const Before before = [&] {
    const fuzz::ScratchFile original("good.db");
    original.write(good);
    Before found{segments_as_text(original.path()), {}};
    const HistoryCheck check = check_history(original.path(), {}, known_setup);
    FUZZ_REQUIRE(check.is_sound() && check.segments.size() == found.texts.size());
    for (const SegmentCheck& part : check.segments) found.records[part.segment.id] = part.records;
    return found;
  }();
  HistoryCheck check;
  try {
    check = check_history(file, {}, known_setup);
  } catch (const HistoryError&) {
    return;
  }
  for (const std::string& segment : segments_as_text(file)) {
    if (std::count(before.texts.begin(), before.texts.end(), segment) == 0) continue;
    const std::int64_t id = std::stoll(segment);
    const auto part = std::find_if(check.segments.begin(), check.segments.end(),
                                   [id](const SegmentCheck& of) { return of.segment.id == id; });
    const bool is_reported =
        std::any_of(check.damage.begin(), check.damage.end(),
                    [id](const HistoryDamage& of) { return of.segment == id; });
    FUZZ_REQUIRE(part != check.segments.end() || is_reported);
    if (part == check.segments.end()) continue;
    if (!part->damage.empty()) std::fprintf(stderr, "%s\n", to_string(part->damage[0]).c_str());
    FUZZ_REQUIRE(part->damage.empty());
    FUZZ_REQUIRE(part->records == before.records.at(id));
  }
}

/// A file may claim hours of cycles, which take time to replay: not a finding.
bool takes_long(const std::filesystem::path& file) {
  constexpr std::uint64_t cycles_max = 4000;
  try {
    std::uint64_t cycles = 0;
    const HistoryReader reader(file);
    for (const SegmentInfo& segment : reader.segments())
      cycles += static_cast<std::uint64_t>(segment.last_cycle + 1) - segment.first_cycle;
    return cycles > cycles_max;
  } catch (const HistoryError&) {
    return false;  // refusals are immediate
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<std::uint8_t> good = fuzz::recorded_history();
  static const fuzz::ScratchFile file("h.db");
  fuzz::ByteFeed feed(data, size);
  file.write(good);
  if (!feed.empty()) {
    Editor editor(file.path());
    for (int i = 0; i < edits_max && !feed.empty(); ++i) edit(editor, feed);
  }
  if (takes_long(file.path())) return 0;
  const fuzz::HistoryUse use = fuzz::use_history(file.path(), known_setup);
  check_untouched(file.path(), good);
  if (size == 0) {
    FUZZ_REQUIRE(use.replayed && use.exported);
    FUZZ_REQUIRE(use.summary.compared > 0 && use.summary.different == 0);
    FUZZ_REQUIRE(use.summary.damage.empty());
  }
  return 0;
}
