/// Stretches of a recording without a row or a value.
#pragma once

#include <cstddef>
#include <vector>

#include "config/runs/run_file.hpp"

namespace thermocomp::inspection {

/// From row to row [s].
[[nodiscard]] std::vector<double> steps_of(const RunFile& run);
/// Nine rows in ten are a step apart, give or take a fifth.
[[nodiscard]] bool is_regular(const std::vector<double>& steps, double step_s);
/// From how many seconds on a stretch without a value is a gap.
[[nodiscard]] double gap_s_min(const RunFile& run);
/// Rows of the first value after each gap of the column, be it that rows or its values are missing.
[[nodiscard]] std::vector<std::size_t> ends_of_gaps(const RunFile& run,
                                                    const std::vector<double>& column);

}  // namespace thermocomp::inspection
