/// The daemon's estimator over a run file instead of a bus.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "config/daemon_config.hpp"
#include "config/run_file.hpp"

namespace thermocomp::cli {

/// What a configuration would have sent, had it been there when the run was recorded: the
/// estimator is stepped at the loop's rate from the file's first row on, each row's values are
/// read at the first cycle at or after its time, and the controller applies at once what it is
/// sent. Compensation is enabled whatever the configuration says about the first start.
///
/// A sensor's values come from the column `<sensor>_degC`, or else from the column called like its
/// block's input. A missing value is no reading. Operating signals come from the column of their
/// name; a signal without a column is missing.
///
/// @return a row for each row of the selection: time_s and, for each axis, `<axis>_offset_um` and
///         `<axis>_target_um`
/// @param progress  called now and then with the fraction done, 0..1
/// @throws ConfigurationError when a sensor has no column
[[nodiscard]] RunFile replay_run(const DaemonConfig& config, const RunFile& run,
                                 const std::function<void(double)>& progress);

/// What in the configuration does not suit the run file; shown to the user. Empty: nothing.
[[nodiscard]] std::vector<std::string> doubts_about(const DaemonConfig& config, const RunFile& run);

}  // namespace thermocomp::cli
