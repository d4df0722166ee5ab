/// Which of the segments of a file can be those of one history. Only for the .cpp files of this
/// folder.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "daemon/history/format/segment_info.hpp"

namespace thermocomp {

/// Beyond these limits the arithmetic of times would overflow, or a replay would never end.
inline constexpr std::int64_t grid_ns_max = std::int64_t{1} << 60;  ///< 36 years of a system's run
inline constexpr std::int64_t span_ns_max = std::int64_t{1} << 55;  ///< a year; segments last weeks
inline constexpr std::int64_t wall_ns_max = std::int64_t{1} << 62;  ///< in the year 2116

[[nodiscard]] constexpr bool is_wall_time(std::int64_t wall_ns) noexcept {
  return wall_ns >= 0 && wall_ns <= wall_ns_max;
}

/// @throws HistoryError when the numbers of the segment are impossible, its wall time apart
void check_times(const SegmentInfo& segment);

/// Leaves out, and tells in `damage`: a segment on another grid than most of its run; one that
/// begins before the one in front of it ends; one whose times go beyond all bounds. Replaces an
/// impossible wall time by a likely one.
/// @param segments  by id, each passed by check_times()
[[nodiscard]] std::vector<SegmentInfo> sound_segments(std::vector<SegmentInfo> segments,
                                                      std::vector<HistoryDamage>& damage);

/// Places segments one after the other in the history's own time: within a run of the daemon the
/// grid counts; between two of them the wall clock does, but time never runs backwards.
class HistoryPlaces {
 public:
  /// @return why the segment cannot follow those before it; empty: it does, and has its place
  std::string add(const SegmentInfo& segment);
  /// From the grid of `run` to the history's time. @pre a segment of it has its place
  [[nodiscard]] std::int64_t grid_to_history_ns(std::int64_t run) const {
    return grid_to_history_ns_.at(run);
  }

 private:
  std::map<std::int64_t, std::int64_t> grid_to_history_ns_;
  std::int64_t first_wall_ns_{0};
  std::int64_t end_ns_{0};  ///< of the segments so far
};

}  // namespace thermocomp
