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
///   event    what happened (recorded_event.hpp), the newest; a file of an earlier version gets the
///            table when it is opened for writing
/// segment and chunk have a checksum (row_checksum.hpp); files of earlier versions get the columns
/// when they are opened for writing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <sys/types.h>

#include "config/daemon/daemon_config.hpp"
#include "daemon/history/format/chunk_codec.hpp"
#include "daemon/history/format/database.hpp"
#include "daemon/history/format/recorded_event.hpp"
#include "daemon/history/writing/writer_inputs.hpp"
#include "daemon/locks/file_lock.hpp"
#include "daemon/recording/grid.hpp"
#include "daemon/recording/record.hpp"

namespace thermocomp {

struct SegmentRow {
  std::int64_t token{0};  ///< the writer's own number; the file has another
  std::shared_ptr<const HistorySetup> setup;
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
  using Row = std::variant<SegmentRow, ChunkRow, RecordedEvent>;
  void add(SegmentRow row);
  void add(ChunkRow row);
  void add(RecordedEvent row);
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
  HistoryStore(const HistoryConfig& config, WriterClocks clocks)
      : config_(config), clocks_(std::move(clocks)) {}

  /// @param needed_token  a segment that must be in the file already; 0: none
  /// @return false when that segment is not in the file: its rows have no place there
  /// @throws DatabaseError; HistoryError when the file is not ours or of a newer version, or
  ///         another process writes it
  [[nodiscard]] bool open_if_closed(std::int64_t needed_token);
  void close() noexcept;
  /// Renames the file (and its log) to `<file>.damaged-<UTC>` and says so in the log.
  void move_aside(const std::string& why) noexcept;

  /// All rows in one transaction.
  /// @param prove  writes something even without rows, to see whether the disk works
  void write(const PendingRows& pending, bool prove);
  /// Deletes the oldest whole segments until size and age are in bounds. Age counts only while the
  /// wall clock has gone as steadily as the monotonic one for an hour: a clock set wrong for a
  /// moment must not cost the history.
  void keep_within_bounds(std::int64_t current_token);

  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::uint64_t segments() const noexcept { return segments_; }

 private:
  using Tokens = std::map<std::int64_t, std::int64_t>;  ///< token -> segment.id

  void lock();
  void prepare();
  void create();
  [[nodiscard]] bool is_same_file() const noexcept;
  void insert(const SegmentRow& row, Tokens& tokens);
  void insert(const ChunkRow& row, const Tokens& tokens);
  void insert(const RecordedEvent& row);
  void forget_old_events();
  [[nodiscard]] bool is_known(std::int64_t segment, const ChunkRow& row);
  [[nodiscard]] std::int64_t setup_id(const HistorySetup& setup);
  void delete_segment(std::int64_t id);
  [[nodiscard]] std::int64_t wall_now_ns() const { return clocks_.wall().count(); }
  [[nodiscard]] bool wall_clock_is_steady();
  [[nodiscard]] std::int64_t oldest_other_than(std::int64_t current, std::int64_t& last_wall_ns);

  HistoryConfig config_;
  WriterClocks clocks_;
  std::unique_ptr<FileLock> lock_;
  std::unique_ptr<Database> database_;
  dev_t device_{0};
  ino_t inode_{0};
  std::int64_t run_{0};
  Tokens tokens_;
  std::uint64_t bytes_{0};
  std::uint64_t segments_{0};
  std::optional<nanoseconds> steady_since_;  ///< monotonic
  nanoseconds wall_minus_monotonic_{};
};

}  // namespace thermocomp
