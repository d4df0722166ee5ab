/// Which parts of a history are sound, segment by segment. Only looks: nothing is repaired in
/// place.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "daemon/history/replay/replay.hpp"

namespace thermocomp {

struct SegmentCheck {
  SegmentInfo segment;
  std::uint64_t records{0};           ///< that can be read
  std::vector<HistoryDamage> damage;  ///< none: it is sound
};

struct HistoryCheck {
  std::vector<SegmentCheck> segments;  ///< those that can be read in part at least, oldest first
  std::vector<HistoryDamage> damage;   ///< of the file, and segments that cannot be read at all
  [[nodiscard]] bool is_sound() const noexcept;
};

/// Every row, chunk and record: checksums, the order of
/// records, the state and inputs at the start of each segment, its configuration.
/// @throws HistoryError when nothing can be taken from the file
[[nodiscard]] HistoryCheck check_history(const std::filesystem::path& history,
                                         const Progress& progress = {},
                                         const SetupParser& parser = parse_setup);

}  // namespace thermocomp
