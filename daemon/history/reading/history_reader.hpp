/// Reads a history, also while a daemon writes it: events, segments and records.
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

/// The events, oldest first. Seconds in `from` and `to` count from the first event.
/// @throws HistoryError: no history, or unreadable
[[nodiscard]] std::vector<RecordedEvent> read_events(const std::filesystem::path& history,
                                                     const std::optional<HistoryTime>& from = {},
                                                     const std::optional<HistoryTime>& to = {});

/// At most `count` events after that of `run` and `number`, in this order.
/// @throws HistoryError: no history, or unreadable
[[nodiscard]] std::vector<RecordedEvent> read_events_after(const std::filesystem::path& history,
                                                           std::int64_t run, std::uint64_t number,
                                                           std::int64_t count);

/// State and inputs right before the first cycle of a segment.
struct SegmentStart {
  std::vector<std::byte> estimator_state;
  std::vector<Reading> readings;
  ControllerState controller;
};

class Database;
class HistoryReader;

/// Reads the records of a segment in the order of their arrival at the estimator, chunk by chunk.
class RecordCursor {
 public:
  RecordCursor(const HistoryReader& reader, SegmentInfo segment);
  /// Returns records of sound chunks only: the checksum matches and the whole chunk decodes.
  /// @return false after the last record of the segment's complete cycles
  /// @throws HistoryError when a chunk is damaged or missing, or the segment was deleted
  bool next(Record& out);
  /// After an error: continues with the next existing chunk; the damaged one's records are lost.
  /// @return false if there is none
  bool resume();
  /// Call when the segment has grown: next() continues beyond its previous last cycle.
  void extend(std::int64_t last_cycle);
  /// True if a chunk had an impossible wall time; the last valid difference is then kept.
  [[nodiscard]] bool wall_time_was_impossible() const noexcept { return wall_was_impossible_; }
  /// Wall clock minus grid time, as of the record last returned [ns].
  [[nodiscard]] std::int64_t wall_minus_grid_ns() const noexcept { return wall_minus_grid_ns_; }

 private:
  bool load_chunk();
  void decode(std::vector<std::byte> bytes, std::uint64_t count);

  std::shared_ptr<Database> database_;
  SegmentInfo segment_;
  std::int64_t next_chunk_{0};
  std::int64_t through_;  ///< last complete cycle of the chunks read so far
  std::int64_t wall_minus_grid_ns_;
  bool wall_was_impossible_{false};
  RecordOrder order_;            ///< of the chunks so far
  std::vector<Record> records_;  ///< of the present chunk
  std::size_t given_{0};         ///< number of records returned
};

class HistoryReader {
 public:
  /// Opens the file read-only and lists its segments. Drops an impossible segment (or one that
  /// overlaps the previous one) and reports it in damage(). Replaces an impossible wall time, from
  /// a wrong clock, by an estimate from other segments.
  /// @throws HistoryError naming the file: missing, not a history, unknown version, or unreadable
  explicit HistoryReader(const std::filesystem::path& file);

  /// Oldest first.
  [[nodiscard]] const std::vector<SegmentInfo>& segments() const& noexcept { return segments_; }
  const std::vector<SegmentInfo>& segments() const&& = delete;
  [[nodiscard]] const std::vector<HistoryDamage>& damage() const noexcept { return damage_; }
  /// Time of a cycle since the history's first one, see HistoryPlaces.
  [[nodiscard]] double seconds_at(const SegmentInfo& segment, std::uint64_t cycle) const {
    return places_.seconds_at(segment, cycle);
  }
  [[nodiscard]] SegmentSetup setup(const SegmentInfo& segment) const;
  [[nodiscard]] SegmentStart start(const SegmentInfo& segment) const;

 private:
  friend class RecordCursor;
  std::filesystem::path file_;
  std::shared_ptr<Database> database_;
  std::vector<SegmentInfo> segments_;
  HistoryPlaces places_;
  std::vector<HistoryDamage> damage_;
};

}  // namespace thermocomp
