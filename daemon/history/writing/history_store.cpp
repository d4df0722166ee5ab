#include "daemon/history/writing/history_store.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <iterator>
#include <utility>

#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <system_error>

#include "daemon/history/format/database.hpp"
#include "daemon/history/format/history_time.hpp"
#include "status/status.hpp"

namespace thermocomp {
namespace {

/// Deletion starts below the bound, so that the next commits do not exceed it.
constexpr double delete_at = 0.9;
/// Segments end at `segment_h` or slightly later. A longer one has a damaged row, which must not
/// make the others old.
constexpr double segment_lengths_max = 2.0;

/// Endings of SQLite's files: database, write-ahead log, its index.
constexpr std::array<const char*, 3> file_ends{"", "-wal", "-shm"};
enum FileOf : std::size_t { database_file, wal_file, index_file };

constexpr const char* tables =
    "CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;"
    "CREATE TABLE setup (id INTEGER PRIMARY KEY, config_text TEXT NOT NULL,"
    " model_text TEXT NOT NULL, model_checksum TEXT NOT NULL);"
    "CREATE TABLE segment (id INTEGER PRIMARY KEY, run INTEGER NOT NULL, token INTEGER NOT NULL,"
    " setup INTEGER NOT NULL, reason INTEGER NOT NULL, grid_start_ns INTEGER NOT NULL,"
    " period_ns INTEGER NOT NULL, first_cycle INTEGER NOT NULL, last_cycle INTEGER NOT NULL,"
    " wall_ns INTEGER NOT NULL, last_wall_ns INTEGER NOT NULL, records INTEGER NOT NULL,"
    " bytes INTEGER NOT NULL, program_version TEXT NOT NULL, inputs BLOB NOT NULL,"
    " estimator_state BLOB NOT NULL, checksum INTEGER);"
    "CREATE TABLE chunk (id INTEGER PRIMARY KEY, segment INTEGER NOT NULL,"
    " number INTEGER NOT NULL, through_cycle INTEGER NOT NULL,"
    " wall_minus_grid_ns INTEGER NOT NULL, count INTEGER NOT NULL, records BLOB NOT NULL,"
    " checksum INTEGER);"
    "CREATE UNIQUE INDEX chunk_of_segment ON chunk (segment, number);"
    "CREATE TABLE event (run INTEGER NOT NULL, number INTEGER NOT NULL, wall_ns INTEGER NOT NULL,"
    " kind TEXT NOT NULL, subject TEXT NOT NULL, what TEXT NOT NULL,"
    " duration_ns INTEGER NOT NULL, user INTEGER NOT NULL, record TEXT NOT NULL DEFAULT '',"
    " PRIMARY KEY (run, number)) WITHOUT ROWID;"
    "INSERT INTO meta VALUES ('format', 'thermocomp history'), ('schema_version', '1');";

/// The event table keeps at most this many events, and at most a twentieth of the file.
constexpr double events_max = 20000.0;
constexpr double event_bytes = 400.0;

std::string utc_stamp() {
  return fmt::format("{:%Y%m%dT%H%M%SZ}", fmt::gmtime(std::time(nullptr)));
}

/// Rolls back unless committed.
class Transaction {
 public:
  explicit Transaction(Database& database) : database_(database) {
    database_.run("BEGIN IMMEDIATE");
  }
  ~Transaction() {
    if (!committed_) {
      // May fail if SQLite has rolled back already.
      sqlite3_exec(database_.handle(), "ROLLBACK", nullptr, nullptr, nullptr);
    }
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  void commit() {
    database_.run("COMMIT");
    committed_ = true;
  }

 private:
  Database& database_;
  bool committed_{false};
};

}  // namespace

void PendingRows::add(SegmentRow row) {
  bytes_ += row.estimator_state.size() + row.inputs.size();
  rows_.emplace_back(std::move(row));
}

void PendingRows::add(ChunkRow row) {
  bytes_ += row.records.size() + sizeof(ChunkRow);
  records_ += static_cast<std::uint64_t>(row.count);
  rows_.emplace_back(std::move(row));
}

void PendingRows::add(Event row) {
  bytes_ += sizeof(Event) + row.detail.size();
  rows_.emplace_back(std::move(row));
}

void PendingRows::clear() {
  *this = PendingRows();
}

bool PendingRows::begins(std::int64_t segment_token) const noexcept {
  return std::any_of(rows_.begin(), rows_.end(), [&](const Row& row) {
    const auto* segment = std::get_if<SegmentRow>(&row);
    return segment != nullptr && segment->token == segment_token;
  });
}

HistoryStore::Files HistoryStore::look_at_files() const {
  Files files{};
  for (std::size_t i = 0; i < files.size(); ++i) {
    struct stat status {};
    if (stat((config_.file.string() + file_ends[i]).c_str(), &status) == 0)
      files[i] = {status.st_dev, status.st_ino, i == wal_file ? status.st_size : 0};
  }
  return files;
}

/// Name of the file that another program changed; empty: none.
std::string HistoryStore::changed_file() const {
  const Files now = look_at_files();
  for (std::size_t i = 0; i < now.size(); ++i)
    if (!now[i].is_same_file(files_[i]) || now[i].bytes < files_[i].bytes)
      return config_.file.string() + file_ends[i];
  return {};
}

void HistoryStore::note_files() {
  const Files now = look_at_files();
  for (std::size_t i = 0; i < now.size(); ++i)
    if (now[i].is_same_file(files_[i])) files_[i] = now[i];
}

bool HistoryStore::open_if_closed(std::int64_t needed_token) {
  if (const std::string changed = database_ ? changed_file() : ""; !changed.empty())
    rescue(changed);
  if (!database_) {
    if (!look_at_files()[database_file].is_same_file(files_[database_file])) {
      run_ = 0;
      tokens_.clear();
      chunks_before_ = 0;
    }
    try {
      prepare();
    } catch (...) {
      database_.reset();
      throw;
    }
  }
  return needed_token == 0 || tokens_.count(needed_token) != 0;
}

/// Handles a file that another program removed or replaced; SQLite would continue to write into
/// unlinked ones. Moves committed data through the open connection into the database, if that is
/// still in place. It then needs no -wal and -shm, and older ones would damage it.
void HistoryStore::rescue(const std::string& changed) {
  const Files now = look_at_files();
  const bool has_database = now[database_file].is_same_file(files_[database_file]);
  const bool is_wal_ours = now[wal_file].is_same_file(files_[wal_file]);
  const bool is_cut = is_wal_ours && now[wal_file].bytes < files_[wal_file].bytes;
  int in_log = 0;
  int moved = -1;
  int code = SQLITE_ERROR;
  try {
    if (has_database) chunks_before_ = database_->number("SELECT count(*) FROM chunk");
    // A failed checkpoint sets both numbers to -1.
    if (!is_cut)
      code = sqlite3_wal_checkpoint_v2(database_->handle(), nullptr, SQLITE_CHECKPOINT_FULL,
                                       &in_log, &moved);
  } catch (const DatabaseError&) {
    // The log is unreadable: only the database's content is left.
  }
  // This connection has the only copy of a removed log and stays open until the disk accepts all of
  // it, since a partial copy would damage the database.
  const DatabaseError failed(code, changed + " was removed, and the disk takes nothing (" +
                                       sqlite3_errstr(code) + "): tried again");
  if (failed.is_temporary() && has_database) throw failed;
  const bool is_moved = code == SQLITE_OK && in_log == moved;
  // Otherwise closing would checkpoint again and delete the file with the log's name.
  sqlite3_db_config(database_->handle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  close();
  if (has_database ? is_moved || is_cut || !is_wal_ours : is_wal_ours) {
    std::error_code ignored;
    for (const char* end : {"-wal", "-shm"})
      std::filesystem::remove(config_.file.string() + end, ignored);
  }
  ++replaced_;
  messages_.push_back(changed + " was removed, replaced or cut while the history was written; " +
                      (has_database ? "reopened" : "a new history begins"));
}

/// Held until the end, also while the file is closed, moved aside or missing.
void HistoryStore::lock() {
  if (lock_) return;
  try {
    lock_ = std::make_unique<FileLock>(config_.file);
  } catch (const LockHeld& held) {
    throw HistoryError("history: " + std::string(held.what()) +
                       "; history.file must name another, or that one must end first");
  } catch (const LockImpossible& problem) {
    throw DatabaseError(SQLITE_CANTOPEN, problem.what());
  }
}

void HistoryStore::prepare() {
  lock();
  database_ = std::make_unique<Database>(config_.file, DatabaseMode::read_write_create);
  const bool is_empty = is_without_tables(*database_);
  if (!is_empty) require_history(*database_);
  database_->run("PRAGMA cache_size = -512; PRAGMA synchronous = FULL; PRAGMA temp_store = MEMORY");
  if (is_empty) create();
  database_->run(
      // Every commit is checkpointed at once, so that a removed -wal costs no data.
      "PRAGMA journal_mode = WAL; PRAGMA journal_size_limit = 1048576;"
      "PRAGMA wal_autocheckpoint = 1");
  if (!has_event_records(*database_))
    database_->run("ALTER TABLE event ADD COLUMN record TEXT NOT NULL DEFAULT ''");
  if (run_ == 0)
    run_ = database_->number(
               "SELECT max((SELECT ifnull(max(run), 0) FROM segment),"
               " (SELECT ifnull(max(run), 0) FROM event))") +
           1;
  forget_lost_tokens();
  files_ = look_at_files();
}

/// Forgets segments with missing rows in the file, so that they get no more.
void HistoryStore::forget_lost_tokens() {
  const std::int64_t chunks = database_->number("SELECT count(*) FROM chunk");
  if (chunks < chunks_before_) {
    tokens_.clear();
    messages_.push_back(fmt::format("{} of {} committed parts are lost with it",
                                    chunks_before_ - chunks, chunks_before_));
  }
  chunks_before_ = 0;
  std::erase_if(tokens_, [this](const Tokens::value_type& token) {
    return database_->number("SELECT 1 FROM segment WHERE id = ? AND run = ? AND token = ?",
                             token.second, run_, token.first) == 0;
  });
}

void HistoryStore::create() {
  // Must precede the first table: lets deleted segments' pages be returned to the system.
  database_->run("PRAGMA auto_vacuum = INCREMENTAL");
  Transaction transaction(*database_);
  database_->run(tables);
  database_->run(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}",
                             history_application_id, history_version)
                     .c_str());
  transaction.commit();
}

void HistoryStore::close() noexcept {
  database_.reset();
}

void HistoryStore::move_aside(const std::string& why) noexcept {
  close();
  try {
    const std::string from = config_.file.string();
    std::string to = from + ".damaged-" + utc_stamp();
    for (int i = 2; std::filesystem::exists(to); ++i) {
      to = from + ".damaged-" + utc_stamp() + "-" + std::to_string(i);
    }
    ++replaced_;
    messages_.push_back(why + "; moved to " + to + ", a new history begins");
    std::error_code ignored;
    std::filesystem::rename(from, to, ignored);
    for (const char* end : {"-wal", "-shm"}) {
      std::filesystem::rename(from + end, to + end, ignored);
    }
  } catch (const std::exception& error) {
    messages_.push_back(std::string("a damaged file could not be moved aside: ") + error.what());
  }
}

void HistoryStore::write(const PendingRows& pending, bool prove) {
  if (pending.rows().empty() && !prove) return;
  Tokens tokens = tokens_;
  Transaction transaction(*database_);
  if (prove)
    database_->run("INSERT OR REPLACE INTO meta VALUES ('opened_wall_ns', ?)",
                   std::to_string(wall_now_ns()));
  for (const PendingRows::Row& row : pending.rows()) {
    if (const auto* segment = std::get_if<SegmentRow>(&row)) {
      insert(*segment, tokens);
    } else if (const auto* chunk = std::get_if<ChunkRow>(&row)) {
      insert(*chunk, tokens);
    } else {
      insert(std::get<Event>(row));
    }
  }
  transaction.commit();
  // Only the newest segment can get further rows.
  if (!tokens.empty()) tokens.erase(tokens.begin(), std::prev(tokens.end()));
  tokens_ = std::move(tokens);
  note_files();
  read_back(pending);
}

void HistoryStore::read_back(const PendingRows& pending) {
  Database reader(config_.file, DatabaseMode::read_only);
  const auto require = [&](const char* sql, const auto&... values) {
    if (reader.number(sql, values...) == 0)
      throw HistoryError(config_.file.string() + ": committed records cannot be read back");
  };
  for (const PendingRows::Row& row : pending.rows()) {
    if (const auto* segment = std::get_if<SegmentRow>(&row)) {
      require("SELECT 1 FROM segment WHERE run = ? AND token = ?", run_, segment->token);
    } else if (const auto* chunk = std::get_if<ChunkRow>(&row)) {
      require(
          "SELECT 1 FROM chunk JOIN segment ON segment.id = chunk.segment"
          " WHERE run = ? AND token = ? AND number = ? AND chunk.records = ?",
          run_, chunk->segment_token, chunk->number, chunk->records);
    } else {
      require("SELECT 1 FROM event WHERE run = ? AND number = ?", run_,
              static_cast<std::int64_t>(std::get<Event>(row).number));
    }
  }
}

std::int64_t HistoryStore::setup_id(const SegmentSetup& setup) {
  const std::int64_t known = database_->number(
      "SELECT id FROM setup WHERE config_text = ? AND model_text = ? AND model_checksum = ?",
      setup.config_text, setup.model_text, setup.model_checksum);
  if (known != 0) return known;
  database_->run("INSERT INTO setup (config_text, model_text, model_checksum) VALUES (?, ?, ?)",
                 setup.config_text, setup.model_text, setup.model_checksum);
  return sqlite3_last_insert_rowid(database_->handle());
}

void HistoryStore::insert(const SegmentRow& row, Tokens& tokens) {
  // A commit reported as failed may have succeeded.
  std::int64_t& id = tokens[row.token];
  id = database_->number("SELECT id FROM segment WHERE run = ? AND token = ?", run_, row.token);
  if (id != 0) return;
  const auto first_cycle = static_cast<std::int64_t>(row.first_cycle);
  database_->run(
      "INSERT INTO segment (run, token, setup, reason, grid_start_ns, period_ns, first_cycle,"
      " last_cycle, wall_ns, last_wall_ns, records, bytes, program_version, inputs,"
      " estimator_state) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, 0, 0, ?, ?, ?)",
      run_, row.token, setup_id(*row.setup), static_cast<std::int64_t>(row.reason),
      row.grid.start.count(), row.grid.period.count(), first_cycle, first_cycle - 1, row.wall_ns,
      row.wall_ns, row.program_version, row.inputs, row.estimator_state);
  id = sqlite3_last_insert_rowid(database_->handle());
  database_->run("UPDATE segment SET checksum = ? WHERE id = ?", segment_checksum(*database_, id),
                 id);
}

/// True if the row exists, from a commit reported as failed. Existing rows are never replaced.
bool HistoryStore::is_known(std::int64_t segment, const ChunkRow& row) {
  Statement known(*database_, "SELECT records FROM chunk WHERE segment = ? AND number = ?", segment,
                  row.number);
  if (!known.step()) return false;
  if (known.blob(0) != row.records)
    throw HistoryError(config_.file.string() + ": chunk " + std::to_string(row.number) +
                       " of segment " + std::to_string(segment) +
                       " already exists with other records; is another program writing it?");
  return true;
}

void HistoryStore::insert(const ChunkRow& row, const Tokens& tokens) {
  const auto segment = tokens.find(row.segment_token);
  if (segment == tokens.end()) throw HistoryError("a chunk without its segment");
  if (is_known(segment->second, row)) return;
  database_->run(
      "INSERT INTO chunk (segment, number, through_cycle,"
      " wall_minus_grid_ns, count, records, checksum)"
      " VALUES (?, ?, ?, ?, ?, ?, ?)",
      segment->second, row.number, row.through_cycle, row.wall_minus_grid_ns, row.count,
      row.records, checksum_of(row));
  database_->run(
      "UPDATE segment SET last_cycle = ?, last_wall_ns = ?, records = records + ?,"
      " bytes = bytes + ? WHERE id = ?",
      row.through_cycle, wall_now_ns(), row.count, std::ssize(row.records), segment->second);
}

/// Ignores an existing event, from a commit reported as failed.
void HistoryStore::insert(const Event& row) {
  const std::string record =
      json_of(row).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  database_->run("INSERT OR IGNORE INTO event VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", run_,
                 static_cast<std::int64_t>(row.number), std::llround(1e9 * row.wall_s),
                 to_string(row.kind), subject_text(row.subject), what_text(row),
                 std::isfinite(row.duration_s) ? std::llround(1e9 * row.duration_s) : -1, row.user,
                 record);
}

void HistoryStore::forget_old_events() {
  const double room = 0.05 * config_.size_MB_max * 1e6 / event_bytes;
  const auto kept = static_cast<std::int64_t>(std::min(events_max, room));
  if (database_->number("SELECT count(*) FROM event") <= kept) return;
  // Deletes more at once, so that not every commit has to.
  database_->run(
      "DELETE FROM event WHERE (run, number) IN (SELECT run, number FROM event"
      " ORDER BY run DESC, number DESC LIMIT -1 OFFSET ?)",
      kept - kept / 10);
}

HistoryStore::OldSegment HistoryStore::oldest_other_than(std::int64_t current) {
  Statement oldest(*database_,
                   "SELECT id, records, (SELECT total(min(max(last_cycle - first_cycle + 1, 0)"
                   " * period_ns, ?)) FROM segment AS later WHERE later.id > segment.id)"
                   " FROM segment WHERE id <> ? ORDER BY id LIMIT 1",
                   static_cast<std::int64_t>(segment_lengths_max * config_.segment_h * 3600e9),
                   current);
  if (!oldest.step()) return {};
  return {oldest.number(0), oldest.number(1), static_cast<double>(oldest.number(2))};
}

void HistoryStore::delete_segment(std::int64_t id) {
  Transaction transaction(*database_);
  database_->run("DELETE FROM chunk WHERE segment = ?", id);
  database_->run("DELETE FROM segment WHERE id = ?", id);
  database_->run("DELETE FROM setup WHERE id NOT IN (SELECT setup FROM segment)");
  transaction.commit();
}

void HistoryStore::report_deleted(std::int64_t count, std::int64_t records,
                                  const std::string& why) {
  if (count == 0) return;
  deleted_ += static_cast<std::uint64_t>(count);
  messages_.push_back(
      fmt::format("the oldest {} segments ({} records) deleted: {}", count, records, why));
}

void HistoryStore::keep_within_bounds(std::int64_t current_token) {
  forget_old_events();
  const auto token = tokens_.find(current_token);
  const std::int64_t current = token == tokens_.end() ? 0 : token->second;
  const double page_bytes = static_cast<double>(database_->number("PRAGMA page_size"));
  const double bytes_max = config_.size_MB_max * 1e6;
  std::int64_t old_count = 0;
  std::int64_t old_records = 0;
  std::int64_t much_count = 0;
  std::int64_t much_records = 0;
  for (;;) {
    const auto used = static_cast<double>(database_->number("PRAGMA page_count") -
                                          database_->number("PRAGMA freelist_count"));
    const OldSegment oldest = oldest_other_than(current);
    const bool is_old = oldest.age_ns > config_.age_days_max * 86400e9;
    const bool is_much = used * page_bytes > delete_at * bytes_max;
    if (oldest.id == 0 || !(is_old || is_much)) break;
    (is_old ? old_count : much_count) += 1;
    (is_old ? old_records : much_records) += oldest.records;
    delete_segment(oldest.id);
  }
  report_deleted(old_count, old_records,
                 fmt::format("more than {} days were recorded after them (history.age_days_max)",
                             config_.age_days_max));
  report_deleted(much_count, much_records,
                 fmt::format("the file reaches {} MB (history.size_MB_max)", config_.size_MB_max));
  // Free pages are reused; only those beyond the bound are returned.
  if (static_cast<double>(database_->number("PRAGMA page_count")) * page_bytes > bytes_max) {
    database_->run("PRAGMA incremental_vacuum");
  }
  bytes_ = static_cast<std::uint64_t>(static_cast<double>(database_->number("PRAGMA page_count")) *
                                      page_bytes);
  segments_ = static_cast<std::uint64_t>(database_->number("SELECT count(*) FROM segment"));
  note_files();
}

}  // namespace thermocomp
