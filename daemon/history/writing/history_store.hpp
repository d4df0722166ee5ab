/// The history's tables: creating them, adding rows, deleting the oldest. One thread at a time.
/// Only for the .cpp files of this folder.
///
/// Tables (PRAGMA user_version 1, PRAGMA application_id "thco"):
///   meta     key, value: what wrote the file
///   setup    configuration text, model text, model checksum; shared by segments
///   segment  where a replay can start: run (one number for each start of the daemon), grid, first
///            and last whole cycle, wall clock, reason, the estimator's exact state, the inputs in
///            force
///   chunk    the records of a segment in order, packed (chunk_codec.hpp), one row or more per
///            commit; wall_minus_grid_ns: wall clock minus the grid's time when it was written
///   event    what happened (status/event.hpp), the newest
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
  std::int64_t token{0};  ///< the writer's own number; the file has another
  std::shared_ptr<const SegmentSetup> setup;
  SegmentReason reason{SegmentReason::start};
  Grid grid;
  std::uint64_t first_cycle{0};
  std::int64_t wall_ns{0};
  std::string program_version;
  std::vector<std::byte> estimator_state;
  std::vector<std::byte> inputs;
};

struct ChunkRow {
  std::int64_t segment_token{0};
  std::int64_t number{0};
  std::int64_t through_cycle{-1};  ///< every cycle up to this one is in this chunk or before it
  std::int64_t wall_minus_grid_ns{0};
  std::uint64_t count{0};
  std::vector<std::byte> records;
};

/// What waits for the next commit.
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
  /// Whether the segment's own row waits here too.
  [[nodiscard]] bool begins(std::int64_t segment_token) const noexcept;

 private:
  std::vector<Row> rows_;
  std::size_t bytes_{0};
  std::uint64_t records_{0};
};

class HistoryStore {
 public:
  /// @param wall_clock  since 1970, may be stepped
  HistoryStore(const HistoryConfig& config, std::function<nanoseconds()> wall_clock)
      : config_(config), wall_clock_(std::move(wall_clock)) {}

  /// The database, its -wal and its -shm are watched together: where one of them was removed,
  /// replaced or cut by another program, what is committed is brought into the database, which is
  /// then opened anew with fresh companions; a database that is gone is begun anew.
  /// @param needed_token  a segment that must be in the file already; 0: none
  /// @return false when that segment is not in the file: its rows have no place there
  /// @throws DatabaseError; HistoryError when the file is not ours or of a newer version, or
  ///         another process writes it
  [[nodiscard]] bool open_if_closed(std::int64_t needed_token);
  void close() noexcept;
  /// After a change of our own, one that failed too: so the files are left. What another program
  /// has put in the place of one stays to be noticed.
  void note_files();
  /// Renames the file (and its log) to `<file>.damaged-<UTC>`.
  void move_aside(const std::string& why) noexcept;

  /// All rows in one transaction. They count as written once a second connection, which opens the
  /// files by their names, has read them back.
  /// @param prove  writes something even without rows, to see whether the disk works
  void write(const PendingRows& pending, bool prove);
  /// Deletes the oldest whole segments until size and age are in bounds. The age of a segment is
  /// the time that was recorded after it, by the monotonic clock: no wall clock, however wrong,
  /// makes it older.
  void keep_within_bounds(std::int64_t current_token);

  /// What somebody must know who looks for rows: segments deleted, files replaced or moved aside;
  /// one sentence each, since the last call.
  [[nodiscard]] std::vector<std::string> take_news() noexcept { return std::exchange(news_, {}); }
  [[nodiscard]] std::uint64_t deleted() const noexcept { return deleted_; }    ///< segments
  [[nodiscard]] std::uint64_t replaced() const noexcept { return replaced_; }  ///< times
  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::uint64_t segments() const noexcept { return segments_; }

 private:
  using Tokens = std::map<std::int64_t, std::int64_t>;  ///< token -> segment.id
  struct FileIdentity {
    dev_t device{0};
    ino_t inode{0};  ///< 0: there is none
    off_t bytes{0};  ///< of the -wal, which shrinks only by its owner
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
    std::int64_t id{0};  ///< 0: there is none
    std::int64_t records{0};
    double age_ns{0.0};
  };
  [[nodiscard]] OldSegment oldest_other_than(std::int64_t current);
  void say_deleted(std::int64_t count, std::int64_t records, const std::string& why);

  HistoryConfig config_;
  std::function<nanoseconds()> wall_clock_;
  std::unique_ptr<FileLock> lock_;
  std::unique_ptr<Database> database_;
  Files files_{};                  ///< as this left them
  std::int64_t chunks_before_{0};  ///< in the file as it was left; 0: not known
  std::int64_t run_{0};
  Tokens tokens_;
  std::uint64_t bytes_{0};
  std::uint64_t segments_{0};
  std::uint64_t deleted_{0};
  std::uint64_t replaced_{0};
  std::vector<std::string> news_;
};

}  // namespace thermocomp
