/// A stretch of a history reduced to some hundred points, for a chart.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/history/reading/history_reader.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "estimator/types.hpp"
#include "status/event.hpp"

namespace thermocomp {

struct ThinnedColumn {
  std::string name;            ///< `<sensor>_degC`, `<axis>_offset_um`
  std::vector<double> values;  ///< one per point; NaN: no good value was recorded
};

/// A displacement measured at the tool.
struct Probing {
  std::string axis;
  double time_s{not_a_number};
  double left_um{not_a_number};    ///< displacement left by the offset in effect; NaN: unknown
  double needed_um{not_a_number};  ///< offset that would have left zero; NaN: unknown
};

struct ThinnedHistory {
  double from_s{0.0};             ///< as requested, or the history's beginning
  double begins_s{not_a_number};  ///< the history's beginning
  std::vector<double> time_s;     ///< centre of each point's interval, wall clock since 1970
  std::vector<ThinnedColumn> columns;
  std::vector<Probing> probings;      ///< in the stretch, and of each axis the last one before it
  std::vector<RecordedEvent> events;  ///< in the stretch and the day before, oldest first
  std::uint64_t chunks{0};            ///< of the history in this stretch
  std::uint64_t chunks_read{0};       ///< if fewer, events shorter than a point may be missing
  std::vector<HistoryDamage> damage;
};

struct ThinningLimits {
  std::size_t points_max{5000};
  std::uint64_t chunks_max{4000};  ///< limit, spread evenly; a chunk is a commit of the daemon
};

/// Divides [from_s, to_s), from the history's beginning on, into `points` equal intervals; a value
/// is the mean of the records in its interval (readings without a fault, offsets as sent). At most
/// `chunks_max` chunks are read, evenly spread, which bounds the time; temperatures change little
/// between them.
/// @param from_s, to_s  wall clock, seconds since 1970
/// @pre to_s > from_s, 1 <= points <= points_max (checked: std::invalid_argument)
/// @throws HistoryError when the file cannot be read at all
[[nodiscard]] ThinnedHistory thin_history(const std::filesystem::path& file, double from_s,
                                          double to_s, std::size_t points,
                                          const ThinningLimits& limits = {},
                                          const SetupParser& parser = parse_setup);

}  // namespace thermocomp
