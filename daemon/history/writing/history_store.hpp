/// The history's tables: creation, insertion, deletion of the oldest rows. One thread at a time.
/// Only for the .cpp files of this folder.
///
/// Tables (PRAGMA user_version 1, PRAGMA application_id "thco"):
///   meta     key, value: the program that wrote the file
///   setup    configuration text, model text, model checksum; shared by segments
///   segment  start point of a replay: run (number of the daemon's start), grid, first and last
///            complete cycle, wall clock, reason, the estimator's exact state, inputs
///   chunk    the records of a segment in order, packed (chunk_codec.hpp), one or more rows per
///            commit; wall_minus_grid_ns: wall clock minus grid time when it was written
///   event    the newest events (status/event.hpp)
/// segment and chunk have a checksum (database.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <sys/types.h>

#include "config/daemon/daemon_config.hpp"
#include "daemon/history/format/chunk_codec.hpp"
#include "daemon/history/format/database.hpp"
#include "daemon/history/format/segments.hpp"
#include "daemon/locks/locks.hpp"
#include "daemon/recording/record.hpp"
#include "status/event.hpp"

namespace thermocomp {

struct SegmentRow {
  std::int64_t token{0};  ///< the writer's number; the file has its own
  std::shared_ptr<const SegmentSetup> setup;
  SegmentReason reason{SegmentReason::start};
  Grid grid;
  std::uint64_t first_cycle{0};
  std::int64_t wall_ns{0};
  std::string program_version;
  std::vector<std::byte> estimator_state;
  std::vector<std::byte> inputs;
};

struct ChunkRow : ChunkContent {
  std::int64_t segment_token{0};
};

/// Rows for the next commit.
class PendingRows {
 public:
  using Row = std::variant<SegmentRow, ChunkRow, Event>;
  void add(SegmentRow row);
  void add(ChunkRow row);
  void add(Event row);
  void clear();
  [[nodiscard]] const std::vector<Row>& rows() const noexcept { return rows_; }
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::uint64_t records() const noexcept { return records_; }
  /// True if the segment's own row is pending too.
  [[nodiscard]] bool begins(std::int64_t segment_token) const noexcept;

 private:
  std::vector<Row> rows_;
  std::size_t bytes_{0};
  std::uint64_t records_{0};
};

class HistoryStore {
 public:
  /// @param wall_clock  since 1970, may step
  HistoryStore(const HistoryConfig& config, std::function<nanoseconds()> wall_clock)
      : config_(config), wall_clock_(std::move(wall_clock)) {}

  /// Watches the database, its -wal and its -shm together: if another program removed, replaced or
  /// truncated one of them, moves committed data into the database and reopens it with new -wal and
  /// -shm; a missing database is created.
  /// @param needed_token  a segment that must be in the file already; 0: none
  /// @return false if that segment is not in the file: its rows cannot be stored
  /// @throws DatabaseError; HistoryError when the file belongs to another program or a newer
  /// version, or another process writes it
  [[nodiscard]] bool open_if_closed(std::int64_t needed_token);
  void close() noexcept;
  /// Records the files' identity; call after every change of our own, even a failed one. A file
  /// replaced by another program is still detected.
  void note_files();
  /// Renames the file (and its -wal) to `<file>.damaged-<UTC>`.
  void move_aside(const std::string& why) noexcept;

  /// Writes all rows in one transaction, and reads them back through a second connection, which
  /// opens the files by name, before they count as written.
  /// @param prove  also writes without rows, to test the disk
  void write(const PendingRows& pending, bool prove);
  /// Deletes the oldest whole segments until size and age are within their bounds. The age of a
  /// segment is the time recorded after it by the monotonic clock, independent of the wall clock.
  void keep_within_bounds(std::int64_t current_token);

  /// Deleted segments and replaced or moved files since the last call, one sentence each.
  [[nodiscard]] std::vector<std::string> take_messages() noexcept {
    return std::exchange(messages_, {});
  }
  [[nodiscard]] std::uint64_t deleted() const noexcept { return deleted_; }    ///< segments
  [[nodiscard]] std::uint64_t replaced() const noexcept { return replaced_; }  ///< times
  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::uint64_t segments() const noexcept { return segments_; }

 private:
  using Tokens = std::map<std::int64_t, std::int64_t>;  ///< token -> segment.id
  struct FileIdentity {
    dev_t device{0};
    ino_t inode{0};  ///< 0: no file
    off_t bytes{0};  ///< of the -wal, which only its owner may shorten
    [[nodiscard]] bool is_same_file(const FileIdentity& other) const noexcept {
      return device == other.device && inode == other.inode;
    }
  };
  using Files = std::array<FileIdentity, 3>;  ///< the database, its -wal, its -shm

  void lock();
  void prepare();
  void create();
  [[nodiscard]] Files look_at_files() const;
  [[nodiscard]] std::string changed_file() const;
  void rescue(const std::string& changed);
  void forget_lost_tokens();
  void read_back(const PendingRows& pending);
  void insert(const SegmentRow& row, Tokens& tokens);
  void insert(const ChunkRow& row, const Tokens& tokens);
  void insert(const Event& row);
  void forget_old_events();
  [[nodiscard]] bool is_known(std::int64_t segment, const ChunkRow& row);
  [[nodiscard]] std::int64_t setup_id(const SegmentSetup& setup);
  void delete_segment(std::int64_t id);
  [[nodiscard]] std::int64_t wall_now_ns() const { return wall_clock_().count(); }
  struct OldSegment {
    std::int64_t id{0};  ///< 0: none
    std::int64_t records{0};
    double age_ns{0.0};
  };
  [[nodiscard]] OldSegment oldest_other_than(std::int64_t current);
  void report_deleted(std::int64_t count, std::int64_t records, const std::string& why);

  HistoryConfig config_;
  std::function<nanoseconds()> wall_clock_;
  std::unique_ptr<FileLock> lock_;
  std::unique_ptr<Database> database_;
  Files files_{};                  ///< as of note_files()
  std::int64_t chunks_before_{0};  ///< chunks in the file when last closed; 0: unknown
  std::int64_t run_{0};
  Tokens tokens_;
  std::uint64_t bytes_{0};
  std::uint64_t segments_{0};
  std::uint64_t deleted_{0};
  std::uint64_t replaced_{0};
  std::vector<std::string> messages_;
};

}  // namespace thermocomp
