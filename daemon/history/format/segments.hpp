/// Segments of a history: their description, plausibility checks, and damage.
#pragma once

#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/recording/record.hpp"

namespace thermocomp {

/// The history cannot be used; the text names the file and the reason.
class HistoryError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// @throws HistoryError "damaged: ..." unless `holds`
inline void require_sound(bool holds, const char* damage) {
  if (!holds) throw HistoryError(std::string("damaged: ") + damage);
}

/// Texts that a replay needs besides the records.
struct SegmentSetup {
  std::string config_text;
  std::string model_text;
  std::string model_checksum;
  bool operator==(const SegmentSetup&) const = default;
};

struct SegmentInfo {
  std::int64_t id{0};
  std::int64_t run{0};    ///< number of the daemon's start
  std::int64_t setup{0};  ///< ID of configuration and model
  SegmentReason reason{SegmentReason::start};
  Grid grid;
  std::uint64_t first_cycle{0};
  /// Last cycle that is recorded completely; first_cycle - 1 if none.
  std::int64_t last_cycle{-1};
  std::int64_t wall_ns{0};  ///< wall clock of first_cycle, since 1970 [ns]
  std::uint64_t records{0};
  std::uint64_t bytes{0};
  std::string program_version;
};

/// A part of a history that cannot be used, with the reason.
struct HistoryDamage {
  std::int64_t segment{0};  ///< 0: the file as a whole
  std::string why;          ///< one line
};
/// "segment 3: chunk 7 is missing"
[[nodiscard]] std::string to_string(const HistoryDamage& damage);

/// Checks the order of records: cycles never decrease, and the offsets of a cycle come last.
class RecordOrder {
 public:
  /// @param first_cycle  lowest valid cycle
  explicit RecordOrder(std::uint64_t first_cycle = 0) : cycle_(first_cycle) {}

  /// @return true if `next` may follow the records so far; otherwise it is ignored
  [[nodiscard]] bool admits(const Record& next) noexcept {
    const bool is_offset = next.kind == RecordKind::offset;
    if (next.cycle < cycle_ || (next.cycle == cycle_ && has_offsets_ && !is_offset)) return false;
    cycle_ = next.cycle;
    has_offsets_ = is_offset;
    return true;
  }

 private:
  std::uint64_t cycle_;
  bool has_offsets_{false};  ///< the newest record is an offset of that cycle
};

/// Beyond these limits time arithmetic would overflow, or a replay would not end.
inline constexpr std::int64_t grid_ns_max = std::int64_t{1} << 60;  ///< 36 years of uptime
inline constexpr std::int64_t span_ns_max = std::int64_t{1}
                                            << 55;  ///< a year; segments last weeks at most
inline constexpr std::int64_t wall_ns_max = std::int64_t{1} << 62;  ///< in the year 2116

[[nodiscard]] constexpr bool is_wall_time(std::int64_t wall_ns) noexcept {
  return wall_ns >= 0 && wall_ns <= wall_ns_max;
}

/// @throws HistoryError when the segment's numbers, except its wall time, are impossible
void check_times(const SegmentInfo& segment);

/// Places segments on the history's own time axis: within a run of the daemon by the grid, between
/// runs by the wall clock, but never backwards.
class HistoryPlaces {
 public:
  /// @return why the segment cannot follow the previous ones; empty: it is placed
  std::string add(const SegmentInfo& segment);
  /// Since the history's first cycle. @pre a segment of the run is placed
  [[nodiscard]] double seconds_at(const SegmentInfo& segment, std::uint64_t cycle) const;

 private:
  std::map<std::int64_t, std::int64_t> grid_to_history_ns_;  ///< by run
  std::int64_t first_wall_ns_{0};
  std::int64_t end_ns_{0};  ///< of the segments so far
};

/// Drops segments, with an entry in `damage`, that are on another grid than most of their run,
/// begin before the end of the previous one, or exceed the limits above. Replaces an impossible
/// wall time by an estimate.
/// @param segments  by id, each passed by check_times()
/// @param places    gets the segments that are kept
[[nodiscard]] std::vector<SegmentInfo> sound_segments(std::vector<SegmentInfo> segments,
                                                      HistoryPlaces& places,
                                                      std::vector<HistoryDamage>& damage);

}  // namespace thermocomp
