/// Loads a recording as a run: either a run file or a daemon's history.
#pragma once

#include <string>

#include "config/runs/run_file.hpp"
#include "report/files.hpp"

namespace thermocomp::cli {

/// RUN.csv[@T0:T1] by `loader`, or a history (also with @T0:T1, seconds since its start) as
/// exported by `thermocomp export`; damage is printed on stderr.
/// @throws ConfigurationError, HistoryError
[[nodiscard]] RunFile load_record(const std::string& argument, RunLoader& loader);

}  // namespace thermocomp::cli
