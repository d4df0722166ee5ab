/// Converts the time of a table to seconds.
#pragma once

#include <optional>
#include <vector>

#include "config/run_forms/find_time.hpp"
#include "config/run_forms/run_data.hpp"

namespace thermocomp {

struct RunTime {
  std::vector<double> time_s;  ///< of each row, in the order of the rows
  std::optional<WallZero> wall_zero;
};

/// Dates, clock times and numbers with an epoch are counted from the first row, other numbers from
/// their own zero. Adds a note to the table.
[[nodiscard]] RunTime read_time(TextTable& table, const TimeColumns& time);

}  // namespace thermocomp
