/// Finds the columns that hold the time of a table.
#pragma once

#include <optional>
#include <vector>

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

/// As mapped; else `time_s`; else the one column that has dates or clock times; else the one of
/// numbers that is called time or has a unit of it, counted from an epoch if their size shows one.
/// Marks the columns; `dates` remains a column of its own.
/// @return nullopt after a problem
[[nodiscard]] std::optional<TimeColumns> find_time(TextTable& table);

}  // namespace thermocomp
