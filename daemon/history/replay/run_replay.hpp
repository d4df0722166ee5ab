/// The daemon's estimator over a run file: what the daemon would have sent on that day.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"
#include "config/runs/run_file.hpp"

namespace thermocomp {

struct RunReplaySummary {
  std::uint64_t rows{0};
  std::uint64_t steps{0};
  double step_period_s{0.0};
  std::vector<std::string> notes;  ///< what was assumed or adapted, for a person
};

/// Time. Steps stand on a grid from the first row on. Its period is the loop's, or, where the rows
/// are further apart, the largest whole multiple of it that is neither longer than the shortest
/// distance of two rows nor than 1 s: the limiter slews by time, not by steps, so nothing is gained
/// by more of them. A row reaches the estimator at the first step at or after its time, with its
/// own time as that of the readings, so screening and smoothing see the true sample times.
///
/// Sensors take `<sensor>_degC`, or else the input column of their block. A missing value renews
/// nothing: the last one ages. Where a sensor's samples are so far apart that the configured
/// `stale_after_s` would call each of them stale before the next one, it is raised to 2.5 times
/// their median distance, which a note says.
///
/// The compensation is switched on, whatever a first start would do. The controller is a dry run:
/// always online, it applies what it was sent by the next step. Its signals are the columns of
/// their names, held from row to row; `cutting_signal` and `disable_signal` without a column are
/// taken for 0, which a note says.
///
/// Output: a run file with the selected rows: time_s, then for each axis `<axis>_offset_um` (sent)
/// and `<axis>_displacement_um` (of its model output, before limits), after the step that saw the
/// row.
/// @throws ConfigurationError: a column that sensors or the model need is missing (all of them at
///         once); the run is too long for its pace (500 million steps)
RunReplaySummary replay_run_file(const DaemonConfig& config, const RunFile& run, std::ostream& out);

}  // namespace thermocomp
