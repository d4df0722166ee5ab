/// Two recordings of one machine, each with a clock of its own, as one run file.
#pragma once

#include <optional>

#include "config/run_forms/run_data.hpp"

namespace thermocomp::cli {

/// Every row of both by the time of the first. In rows that the second brings along, temperatures
/// and positions of the first are on the line between its rows beside them, its other columns are
/// those of the row before; a gap of more than a minute, or three usual steps, stays empty.
/// @param shift_s  the second's time_s plus this is the first's; nullopt: the dates of both files
///                 tell it or, where they have none, columns that clearly change alike
/// @throws ConfigurationError when the clocks cannot be compared, columns are there twice, or the
///         two do not overlap
[[nodiscard]] RunFile joined_runs(const RunFile& first, const RunFile& second,
                                  std::optional<double> shift_s);

}  // namespace thermocomp::cli
