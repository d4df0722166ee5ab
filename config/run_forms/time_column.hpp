/// Finds the time column of a table, and converts it to seconds.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/run_forms/number_form.hpp"
#include "config/run_forms/run_data.hpp"
#include "config/run_forms/text_table.hpp"

namespace thermocomp {

/// Columns of the time: one column; date and clock time; year, day of the year and hhmm; none if
/// the rows have a period.
struct TimeColumns {
  std::vector<std::size_t> columns;
  std::optional<std::size_t> dates;       ///< column with the date at which a counting number was 0
  std::optional<std::size_t> fraction{};  ///< column with the fraction of the second of a clock
  double fraction_factor{1.0};            ///< s per unit of it
  [[nodiscard]] bool has(std::size_t column) const;
};

/// `time_s`; else as mapped; else the one column that has dates or clock times, has a unit of time,
/// counts from 1970 (or another epoch shown by its size), or is called time.
/// @param map  may be nullptr
/// @return nullopt after a problem
[[nodiscard]] std::optional<TimeColumns> find_time(const TextTable& table, const ColumnMap* map,
                                                   const std::vector<std::string>& units,
                                                   const NumberForm& form, ProblemList& problems);

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
