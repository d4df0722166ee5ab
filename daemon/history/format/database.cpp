#include "daemon/history/format/database.hpp"

#include <bit>
#include <fmt/format.h>
#include <stdexcept>
#include <string>

#include <system_error>

#include "config/text/regular_file.hpp"
#include "daemon/history/format/chunk_codec.hpp"

namespace thermocomp {
namespace {

/// For a history on read-only media or in a read-only folder, where SQLite cannot create the
/// write-ahead log's shared-memory file. Without a log there is no writer either.
std::string immutable_uri(const std::filesystem::path& file) {
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(file).string())
    uri += c == '?' || c == '#' || c == '%' ? fmt::format("%{:02X}", static_cast<int>(c))
                                            : std::string(1, c);
  return uri + "?immutable=1";
}

/// Resolves links by the system: SQLite does so recursively with 4 KB of stack per link, and a loop
/// would exceed a thread's stack.
/// @throws DatabaseError
std::filesystem::path followed(const std::filesystem::path& file) {
  std::filesystem::path path = std::filesystem::absolute(file);
  constexpr int links_max = 40;
  std::error_code error;
  for (int links = 0; std::filesystem::is_symlink(path, error); ++links) {
    if (links == links_max) {
      throw DatabaseError(SQLITE_CANTOPEN, file.string() + ": is a loop of links");
    }
    path = path.parent_path() / std::filesystem::read_symlink(path, error);
  }
  std::filesystem::path real = std::filesystem::weakly_canonical(path, error);
  if (error) throw DatabaseError(SQLITE_CANTOPEN, file.string() + ": " + error.message());
  return real;
}

/// Refuses pipes and similar files, on which SQLite's open() would block.
/// @throws DatabaseError
void refuse_what_waits(const std::filesystem::path& real) {
  for (const char* part : {"", "-journal", "-wal", "-shm"}) {
    const std::string file = real.string() + part;
    try {
      require_regular_or_missing(file);
    } catch (const std::runtime_error& error) {
      throw DatabaseError(SQLITE_CANTOPEN, file + ": " + error.what());
    }
  }
}

bool can_read(sqlite3* handle) {
  return sqlite3_exec(handle, "SELECT count(*) FROM sqlite_master", nullptr, nullptr, nullptr) ==
         SQLITE_OK;
}

/// FNV-1a, 64 bits, as SQLite's signed integer. Source: draft-eastlake-fnv, section 2.
class RowChecksum {
 public:
  RowChecksum& add(std::int64_t value) noexcept {
    auto bits = static_cast<std::uint64_t>(value);
    for (int i = 0; i < 8; ++i, bits >>= 8) hash_ = (hash_ ^ (bits & 0xFFu)) * 0x100000001b3u;
    return *this;
  }
  /// Includes the length.
  RowChecksum& add(std::span<const std::byte> bytes) noexcept {
    add(static_cast<std::int64_t>(bytes.size()));
    hash_ = fnv_1a(bytes, hash_);
    return *this;
  }
  [[nodiscard]] std::int64_t value() const noexcept { return std::bit_cast<std::int64_t>(hash_); }

 private:
  std::uint64_t hash_{0xcbf29ce484222325u};
};

}  // namespace

Database::Database(const std::filesystem::path& file, DatabaseMode mode) : file_(file) {
  const bool read_only = mode == DatabaseMode::read_only;
  const std::filesystem::path real = followed(file);
  refuse_what_waits(real);
  const int flags = SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_URI |
                    (read_only ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  int code = sqlite3_open_v2(real.c_str(), &handle_, flags, nullptr);
  // On a read-only mount, or without write permission in the folder, SQLite cannot create its
  // files.
  const auto is_for_lack_of_files = [this] {
    const int error = sqlite3_errcode(handle_);
    return error == SQLITE_CANTOPEN || error == SQLITE_READONLY;
  };
  if (code == SQLITE_OK && read_only && !can_read(handle_) && is_for_lack_of_files() &&
      !std::filesystem::exists(real.string() + "-wal")) {
    sqlite3_close(handle_);
    handle_ = nullptr;
    code = sqlite3_open_v2(immutable_uri(real).c_str(), &handle_, flags, nullptr);
  }
  if (code != SQLITE_OK) {
    const std::string message = file.string() + ": " + sqlite3_errstr(code);
    sqlite3_close(handle_);
    throw DatabaseError(code, message);
  }
  sqlite3_extended_result_codes(handle_, 1);
  sqlite3_busy_timeout(handle_, 2000);
}

Database::~Database() {
  sqlite3_close(handle_);
}

void Database::fail(int code) const {
  throw DatabaseError(code, file_.string() + ": " + sqlite3_errmsg(handle_));
}

void Database::run(const char* sql) {
  const int code = sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(code);
}

bool is_without_tables(Database& database) {
  return database.number("SELECT count(*) FROM sqlite_master") == 0;
}

bool has_event_records(Database& database) {
  return database.number("SELECT count(*) FROM pragma_table_info('event') WHERE name = 'record'") !=
         0;
}

void refuse_foreign_history(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return;
  try {
    Database database(file, DatabaseMode::read_only);
    if (!is_without_tables(database)) require_history(database);
  } catch (const DatabaseError&) {
    // A damaged file is moved aside by the writer, which also retries disk errors.
  }
}

void require_history(Database& database) {
  const std::string name = database.file().string();
  if (database.number("PRAGMA application_id") != history_application_id) {
    throw HistoryError(name + ": is not a history of thermocomp");
  }
  const std::int64_t version = database.number("PRAGMA user_version");
  if (version < 1) {
    throw HistoryError(name + ": is a history of version " + std::to_string(version) +
                       ", which no thermocomp wrote (damaged)");
  }
  if (version > history_version) {
    throw HistoryError(name + ": is a history of version " + std::to_string(version) +
                       ", written by a newer thermocompd; this program supports up to version " +
                       std::to_string(history_version));
  }
}

void Statement::prepare(const char* sql) {
  const int code = sqlite3_prepare_v2(database_.handle(), sql, -1, &handle_, nullptr);
  if (code != SQLITE_OK) database_.fail(code);
}

Statement::~Statement() {
  sqlite3_finalize(handle_);
}

void Statement::bind(std::int64_t value) {
  sqlite3_bind_int64(handle_, ++bound_, value);
}

void Statement::bind(std::string_view value) {
  sqlite3_bind_text(handle_, ++bound_, value.data(), static_cast<int>(value.size()),
                    SQLITE_TRANSIENT);
}

void Statement::bind(std::span<const std::byte> value) {
  // An empty span may have a null pointer, which SQLite would store as NULL.
  sqlite3_bind_blob64(handle_, ++bound_,
                      value.empty() ? "" : static_cast<const void*>(value.data()), value.size(),
                      SQLITE_TRANSIENT);
}

bool Statement::step() {
  const int code = sqlite3_step(handle_);
  if (code == SQLITE_ROW) return true;
  if (code != SQLITE_DONE) database_.fail(code);
  return false;
}

std::int64_t Statement::number(int column) const {
  return sqlite3_column_int64(handle_, column);
}

std::string Statement::text(int column) const {
  const auto* text = static_cast<const char*>(sqlite3_column_blob(handle_, column));
  return {text, static_cast<std::size_t>(sqlite3_column_bytes(handle_, column))};
}

std::vector<std::byte> Statement::blob(int column) const {
  const auto* bytes = static_cast<const std::byte*>(sqlite3_column_blob(handle_, column));
  return {bytes, bytes + sqlite3_column_bytes(handle_, column)};
}

std::int64_t checksum_of(const ChunkContent& chunk) noexcept {
  RowChecksum checksum;
  checksum.add(chunk.number).add(chunk.count).add(chunk.through_cycle);
  return checksum.add(chunk.wall_minus_grid_ns).add(chunk.records).value();
}

std::optional<ChunkContent> read_chunk(Database& database, std::int64_t segment,
                                       std::int64_t number) {
  Statement row(database,
                "SELECT records, count, through_cycle, wall_minus_grid_ns, checksum IS NULL,"
                " checksum FROM chunk WHERE segment = ? AND number = ?",
                segment, number);
  if (!row.step()) return std::nullopt;
  ChunkContent chunk{number, row.number(1), row.number(2), row.number(3), row.blob(0)};
  if (row.number(4) == 0 && row.number(5) != checksum_of(chunk))
    throw HistoryError("chunk " + std::to_string(number) + " does not fit its checksum");
  return chunk;
}

std::int64_t segment_checksum(Database& database, std::int64_t segment) {
  Statement row(database,
                "SELECT run, reason, grid_start_ns, period_ns, first_cycle, wall_ns,"
                " program_version, inputs, estimator_state, config_text, model_text,"
                " model_checksum FROM segment JOIN setup ON setup.id = segment.setup"
                " WHERE segment.id = ?",
                segment);
  if (!row.step()) throw HistoryError("the row of the segment or of its configuration is missing");
  RowChecksum checksum;
  for (int column = 0; column < 6; ++column) checksum.add(row.number(column));
  for (int column = 6; column < 12; ++column) checksum.add(row.blob(column));
  return checksum.value();
}

void check_segment_row(Database& database, std::int64_t segment) {
  Statement row(database, "SELECT checksum FROM segment WHERE id = ? AND checksum IS NOT NULL",
                segment);
  if (row.step() && row.number(0) != segment_checksum(database, segment)) {
    throw HistoryError("the row of the segment, or its configuration, does not fit its checksum");
  }
}

}  // namespace thermocomp
