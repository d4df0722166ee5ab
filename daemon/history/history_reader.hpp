/// Reads a history, also one that a daemon is writing at the moment.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "daemon/history/history_error.hpp"
#include "daemon/recording/grid.hpp"
#include "daemon/recording/record.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

struct SegmentInfo {
  std::int64_t id{0};
  std::int64_t run{0};    ///< one number for each start of the daemon
  std::int64_t setup{0};  ///< which configuration and model
  SegmentReason reason{SegmentReason::start};
  Grid grid;
  std::uint64_t first_cycle{0};
  /// Last cycle that is recorded whole; first_cycle - 1 when there is none yet.
  std::int64_t last_cycle{-1};
  std::int64_t wall_ns{0};  ///< wall clock of first_cycle, since 1970 [ns]
  std::uint64_t records{0};
  std::uint64_t bytes{0};
  std::string program_version;
};

struct SegmentSetup {
  std::string config_text;
  std::string model_text;
  std::string model_checksum;
};

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
  /// @return false after the last record of the segment's whole cycles
  /// @throws HistoryError when the file is damaged or the segment was deleted meanwhile
  bool next(Record& out);
  /// Wall clock minus the grid's time, as noted with the record last returned [ns].
  [[nodiscard]] std::int64_t wall_minus_grid_ns() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

class HistoryReader {
 public:
  /// Opens for reading only and takes note of the segments there are now.
  /// @throws HistoryError naming the file: missing, no history, of a newer version, damaged
  explicit HistoryReader(const std::filesystem::path& file);
  ~HistoryReader();
  HistoryReader(HistoryReader&&) noexcept;

  [[nodiscard]] const std::filesystem::path& file() const noexcept;
  [[nodiscard]] const std::vector<SegmentInfo>& segments() const noexcept;  ///< oldest first
  [[nodiscard]] SegmentSetup setup(const SegmentInfo& segment) const;
  [[nodiscard]] SegmentStart start(const SegmentInfo& segment) const;
  [[nodiscard]] RecordCursor records(const SegmentInfo& segment) const;

 private:
  friend class RecordCursor;
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
