/// Converts the time of a table to seconds.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/run_forms/find_time.hpp"
#include "config/run_forms/run_data.hpp"

namespace thermocomp {

struct RunTime {
  std::vector<double> time_s;  ///< of each row, in the order of the rows
  std::string note;            ///< how it was read
  std::optional<WallZero> wall_zero;
};

/// Dates, clock times and numbers with an epoch are counted from the first row, other numbers from
/// their own zero.
/// @param units  of each column, as written; empty: none
[[nodiscard]] RunTime read_time(const TextTable& table, const TimeColumns& time,
                                const ColumnMap* map, const std::vector<std::string>& units,
                                const NumberForm& form, ProblemList& problems);

}  // namespace thermocomp
