/// RAII wrappers for the part of SQLite that the history uses; errors are exceptions. Only for the
/// .cpp files of this folder.
///
/// SQLite has no checksums, and a packed value with a flipped bit is still valid: `chunk.checksum`
/// covers the chunk's numbers and records, `segment.checksum` the constant part of a segment and
/// the texts of its setup. A NULL checksum is not checked.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <sqlite3.h>

#include "daemon/history/format/segments.hpp"

namespace thermocomp {

/// "thco": marks a SQLite file as a history.
inline constexpr std::int64_t history_application_id = 0x7468636F;
/// Incremented when older programs would misread the file.
inline constexpr std::int64_t history_version = 1;

class DatabaseError : public HistoryError {
 public:
  DatabaseError(int code, const std::string& message) : HistoryError(message), code_(code) {}
  [[nodiscard]] int code() const noexcept { return code_; }
  /// True if the file's content is wrong, as opposed to a disk error.
  [[nodiscard]] bool is_damage() const noexcept {
    return (code_ & 0xFF) == SQLITE_CORRUPT || (code_ & 0xFF) == SQLITE_NOTADB;
  }
  /// True if the disk is full or writing failed temporarily; the connection remains usable.
  [[nodiscard]] bool is_temporary() const noexcept {
    return (code_ & 0xFF) == SQLITE_FULL || code_ == SQLITE_IOERR_WRITE ||
           code_ == SQLITE_IOERR_FSYNC;
  }

 private:
  int code_;
};

enum class DatabaseMode { read_only, read_write_create };

class Database {
 public:
  Database(const std::filesystem::path& file, DatabaseMode mode);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// Statements without a result.
  void run(const char* sql);
  /// One statement without a result. @param values  as of Statement
  template <class... Values>
  void run(const char* sql, const Values&... values);
  /// First column of the first row, or 0. @param values  as of Statement
  template <class... Values>
  [[nodiscard]] std::int64_t number(const char* sql, const Values&... values);
  [[nodiscard]] sqlite3* handle() const noexcept { return handle_; }
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }
  [[noreturn]] void fail(int code) const;

 private:
  std::filesystem::path file_;
  sqlite3* handle_{nullptr};
};

[[nodiscard]] bool is_without_tables(Database& database);

/// @throws HistoryError when the file belongs to another program or has an unknown version
void require_history(Database& database);

/// True if the table `event` has whole records, not only texts as in version 0.1.0.
[[nodiscard]] bool has_event_records(Database& database);

/// The same check before a daemon touches files; accepts a missing, empty or damaged file.
void refuse_foreign_history(const std::filesystem::path& file);

class Statement {
 public:
  /// @param values  of the question marks, in their order
  template <class... Values>
  Statement(Database& database, const char* sql, const Values&... values) : database_(database) {
    prepare(sql);
    (bind(values), ...);
  }
  ~Statement();
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  /// @return true if there is a row
  bool step();
  [[nodiscard]] std::int64_t number(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] std::vector<std::byte> blob(int column) const;

 private:
  void prepare(const char* sql);
  void bind(std::int64_t value);
  void bind(std::string_view value);
  void bind(std::span<const std::byte> value);

  Database& database_;
  sqlite3_stmt* handle_{nullptr};
  int bound_{0};
};

template <class... Values>
void Database::run(const char* sql, const Values&... values) {
  Statement(*this, sql, values...).step();
}

template <class... Values>
std::int64_t Database::number(const char* sql, const Values&... values) {
  Statement statement(*this, sql, values...);
  return statement.step() ? statement.number(0) : 0;
}

struct ChunkContent {
  std::int64_t number{0};
  std::int64_t count{0};           ///< of records
  std::int64_t through_cycle{-1};  ///< cycles up to this one are complete with this chunk
  std::int64_t wall_minus_grid_ns{0};
  std::vector<std::byte> records;
};
[[nodiscard]] std::int64_t checksum_of(const ChunkContent& chunk) noexcept;
/// The row's content; none: no such row. @throws HistoryError when the checksum does not match
[[nodiscard]] std::optional<ChunkContent> read_chunk(Database& database, std::int64_t segment,
                                                     std::int64_t number);

/// The expected checksum of the segment's row. @throws HistoryError: no such row
[[nodiscard]] std::int64_t segment_checksum(Database& database, std::int64_t segment);
/// @throws HistoryError when the checksum does not match
void check_segment_row(Database& database, std::int64_t segment);

}  // namespace thermocomp
