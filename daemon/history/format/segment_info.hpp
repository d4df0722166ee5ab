/// What a history says about its segments, and which parts of it cannot be used.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/recording/grid.hpp"
#include "daemon/recording/record.hpp"

namespace thermocomp {

/// What a replay needs besides the records.
struct SegmentSetup {
  std::string config_text;
  std::string model_text;
  std::string model_checksum;
};

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

/// A part of a history that cannot be used, and why.
struct HistoryDamage {
  std::int64_t segment{0};  ///< 0: the file as a whole
  std::string why;          ///< one line
};
/// "segment 3: chunk 7 is missing"
[[nodiscard]] std::string to_string(const HistoryDamage& damage);

}  // namespace thermocomp
