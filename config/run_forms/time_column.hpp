/// The time of a table: its columns, and their content in seconds.
#pragma once

#include <optional>
#include <vector>

#include "config/run_forms/run_data.hpp"
#include "config/run_forms/text_table.hpp"

namespace thermocomp {

/// Columns of the time: one column; date and clock time; year, day of the year and hhmm; none if
/// the rows have a period.
struct TimeColumns {
  std::vector<std::size_t> columns;
  std::optional<std::size_t> dates{};     ///< column with the date at which a counting number was 0
  std::optional<std::size_t> fraction{};  ///< column with the fraction of the second of a clock
  double fraction_factor{1.0};            ///< s per unit of it
  std::optional<std::size_t> half{};      ///< column with AM or PM of a clock
};

/// The mapped time; else `time_s`; else the only column of dates or clock times; else the only
/// column of numbers that is called time or has a unit of time, counted from an epoch if their size
/// shows one. Marks the columns; `dates` remains a column of its own.
/// @return nullopt after a problem
[[nodiscard]] std::optional<TimeColumns> find_time(TextTable& table);

struct RunTime {
  std::vector<double> time_s;  ///< of each row, in the order of the rows
  std::optional<WallZero> wall_zero;
};

/// Dates, clock times and numbers with an epoch are counted from the first row, other numbers from
/// their own zero. Adds a note to the table.
[[nodiscard]] RunTime read_time(TextTable& table, const TimeColumns& time);

}  // namespace thermocomp
