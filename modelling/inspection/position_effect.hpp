/// What of a displacement goes at once with the axes' positions (a guideway that bends, a screw
/// that has grown), so that an axis that runs to and fro is no probing that went wrong.
#pragma once

#include <cstddef>
#include <vector>

#include "config/runs/run_file.hpp"

namespace thermocomp::inspection {

/// Least squares of the displacement on each position p [mm], p^2 and p times each temperature, all
/// of them and the displacement less their means over seven rows, so that only what is fast
/// decides; rows far off count less (Huber's weights), so that what is looked for does not explain
/// itself.
/// @param column  a displacement
/// @return what goes with the positions at each row, 0 where one of them is missing and everywhere
///         where the run has no position that moves, or too few rows to tell. Shape (rows).
[[nodiscard]] std::vector<double> position_effect(const RunFile& run, std::size_t column);

}  // namespace thermocomp::inspection
