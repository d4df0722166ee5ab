/// A recording as a run file, whether it is a file of numbers or a daemon's history.
#pragma once

#include <string>

#include "config/runs/run_file.hpp"
#include "report/run_loader.hpp"

namespace thermocomp::cli {

/// Whether a file is a database as thermocompd writes its history.
[[nodiscard]] bool is_history(const std::string& file);

/// RUN.csv[@T0:T1] by `loader`, or a history (with @T0:T1 as well, seconds since its start) as
/// `thermocomp export` gives it; what of it is damaged is printed on stderr.
/// @throws ConfigurationError, HistoryError
[[nodiscard]] RunFile load_record(const std::string& argument, RunLoader& loader);

}  // namespace thermocomp::cli
