/// The daemon's estimator applied to a run file: the offsets that it would have sent.
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
  std::vector<std::string> notes;  ///< assumptions and adaptations, for people
};

/// Time: steps are on a grid from the first row on. The period is the loop's or, for rows farther
/// apart, its largest multiple up to the shortest row distance and 1 s; more steps would change
/// nothing, since the limiter slews by time. A row reaches the estimator at the first step at or
/// after its time, which is also that of its readings, so that screening and smoothing get the true
/// sample times.
///
/// Sensors: `<sensor>_degC`, else the input column of their block. A missing value ages the last
/// one. If 2.5 times a sensor's median sample distance exceeds its `stale_after_s`, that time is
/// used instead, with a note.
///
/// Compensation is enabled, independent of `enabled_at_first_start`. The controller is simulated as
/// a dry run: always online, with offsets applied by the next step. Signals come from columns of
/// the same names, held between rows; `cutting_signal` and `disable_signal` without a column are 0,
/// with a note.
///
/// Output: a run file with the selected rows: time_s, then for each axis `<axis>_offset_um` (sent)
/// and `<axis>_displacement_um` (of its model output, before limits), after the step of the row.
/// @throws ConfigurationError: columns of sensors or the model are missing (all are named), or the
///         run needs more than 500 million steps
RunReplaySummary replay_run_file(const DaemonConfig& config, const RunFile& run, std::ostream& out);

}  // namespace thermocomp
