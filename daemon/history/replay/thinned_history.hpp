/// A stretch of a history for a chart: some hundred points, however long it is.
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
  std::vector<double> values;  ///< one per point; NaN: nothing good was recorded there
};

/// A displacement that was measured at the tool.
struct Probing {
  std::string axis;
  double time_s{not_a_number};
  double left_um{not_a_number};    ///< what the offset in effect left of it; NaN: not known
  double needed_um{not_a_number};  ///< the offset that would have left nothing; NaN: not known
};

struct ThinnedHistory {
  double from_s{0.0};          ///< as asked, or when the history begins
  std::vector<double> time_s;  ///< middle of each point's span, wall clock since 1970
  std::vector<ThinnedColumn> columns;
  std::vector<Probing> probings;      ///< of the stretch, and of each axis the last one before it
  std::vector<RecordedEvent> events;  ///< of the stretch and the day before, oldest first
  std::uint64_t chunks{0};            ///< that the history has of this stretch
  std::uint64_t chunks_read{0};       ///< fewer: what lasted shorter than a point may be left out
  std::vector<HistoryDamage> damage;
};

struct ThinningLimits {
  std::size_t points_max{5000};
  std::uint64_t chunks_max{4000};  ///< read at most, spread evenly; one is a commit of the daemon
};

/// Divides [from_s, to_s), from the history's beginning on, into `points` equal spans; a value is
/// the mean of what was recorded in its span (readings without a fault, offsets as sent). Where the
/// stretch has more chunks than `chunks_max`, as many of them are read, evenly spread: the time
/// this takes does not grow with the stretch, and temperatures change little within what is passed
/// over.
/// @param from_s, to_s  wall clock, seconds since 1970
/// @pre to_s > from_s, 1 <= points <= points_max (checked: std::invalid_argument)
/// @throws HistoryError when nothing can be taken from the file
[[nodiscard]] ThinnedHistory thin_history(const std::filesystem::path& file, double from_s,
                                          double to_s, std::size_t points,
                                          const ThinningLimits& limits = {},
                                          const SetupParser& parser = parse_setup);

}  // namespace thermocomp
