/// Reads a history, even one that a daemon is writing at the moment: its events, segments and
/// records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/history/format/history_time.hpp"
#include "daemon/history/format/segments.hpp"
#include "daemon/recording/record.hpp"
#include "estimator/types.hpp"
#include "status/event.hpp"

namespace thermocomp {

/// The events, oldest first. Times of `from` and `to` are wall times; seconds count from the first
/// event.
/// @throws HistoryError: no history, or one that cannot be read
[[nodiscard]] std::vector<RecordedEvent> read_events(const std::filesystem::path& history,
                                                     const std::optional<HistoryTime>& from = {},
                                                     const std::optional<HistoryTime>& to = {});

/// The events after that of `run` and `number`, by run and number, `count` at most.
/// @throws HistoryError: no history, or one that cannot be read
[[nodiscard]] std::vector<RecordedEvent> read_events_after(const std::filesystem::path& history,
                                                           std::int64_t run, std::uint64_t number,
                                                           std::int64_t count);

/// What was in force right before the first cycle of a segment.
struct SegmentStart {
  std::vector<std::byte> estimator_state;
  std::vector<Reading> readings;
  ControllerState controller;
};

class HistoryReader;

/// The records of one segment in the order in which they reached the estimator, a chunk at a time.
class RecordCursor {
 public:
  RecordCursor(const HistoryReader& reader, const SegmentInfo& segment);
  ~RecordCursor();
  RecordCursor(RecordCursor&&) noexcept;
  /// Gives records of sound chunks only: the checksum must fit and the whole chunk must decode.
  /// @return false after the last record of the segment's whole cycles
  /// @throws HistoryError when a chunk is damaged or missing, or the segment was deleted meanwhile
  bool next(Record& out);
  /// After an error: goes on with the next chunk there is. What the damaged one said is unknown.
  /// @return false when there is none
  bool resume();
  /// The segment has grown: next() goes on after what was its last whole cycle.
  void extend(std::int64_t last_cycle);
  /// Whether a chunk so far gave an impossible wall time; the last good difference then counts.
  [[nodiscard]] bool wall_time_was_impossible() const noexcept;
  /// Wall clock minus the grid's time, as noted with the record last returned [ns].
  [[nodiscard]] std::int64_t wall_minus_grid_ns() const noexcept;

 private:
  struct Parts;
  bool load_chunk();
  std::unique_ptr<Parts> parts_;
};

class HistoryReader {
 public:
  /// Opens for reading only and takes note of the segments there are now. An impossible segment (or
  /// one that overlaps the one in front of it) is left out and reported by damage(); an impossible
  /// wall time, from a clock that was set wrong, is replaced by what the segments beside it say.
  /// @throws HistoryError naming the file: missing, no history, of an unknown version, or so
  ///                      damaged that nothing can be taken from it
  explicit HistoryReader(const std::filesystem::path& file);
  ~HistoryReader();
  HistoryReader(HistoryReader&&) noexcept;

  [[nodiscard]] const std::filesystem::path& file() const noexcept;
  [[nodiscard]] const std::vector<SegmentInfo>& segments() const& noexcept;  ///< oldest first
  const std::vector<SegmentInfo>& segments() const&& = delete;
  [[nodiscard]] const std::vector<HistoryDamage>& damage() const noexcept;
  [[nodiscard]] SegmentSetup setup(const SegmentInfo& segment) const;
  [[nodiscard]] SegmentStart start(const SegmentInfo& segment) const;
  [[nodiscard]] RecordCursor records(const SegmentInfo& segment) const;

 private:
  friend class RecordCursor;
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
