/// Which column of a table is the time, and its values as seconds.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/run_forms/number_form.hpp"
#include "config/run_forms/run_data.hpp"
#include "config/run_forms/text_table.hpp"

namespace thermocomp {

/// Where the time stands: one column; a date and the clock time beside it; year, day of the year
/// and hhmm; none where the rows have a period.
struct TimeColumns {
  std::vector<std::size_t> columns;
  std::optional<std::size_t> dates;  ///< beside a number that counts: when it was 0
  [[nodiscard]] bool has(std::size_t column) const;
};

/// `time_s`; else what the map says; else the one column that holds dates or clock times, has a
/// unit of time, counts from 1970 (or another zero that its size shows), or is called time.
/// @param map  may be nullptr
/// @return nullopt after a problem
[[nodiscard]] std::optional<TimeColumns> find_time(const TextTable& table, const ColumnMap* map,
                                                   const std::vector<std::string>& units,
                                                   const NumberForm& form, ProblemList& problems);

struct RunTime {
  std::vector<double> time_s;  ///< of each row, in the order of the rows
  std::string note;            ///< what was understood
  std::optional<WallZero> wall_zero;
};

/// Dates, times of the clock and what counts from a year count from the first row, other numbers
/// from their own zero.
/// @param units  of each column, as written; empty: none
[[nodiscard]] RunTime read_time(const TextTable& table, const TimeColumns& time,
                                const ColumnMap* map, const std::vector<std::string>& units,
                                const NumberForm& form, ProblemList& problems);

}  // namespace thermocomp
