/// Which column of a table is the time, and its values as seconds.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/run_forms/number_form.hpp"
#include "config/run_forms/text_table.hpp"

namespace thermocomp {

/// Where the time stands: one column, or a date and the clock time beside it.
struct TimeColumns {
  std::vector<std::size_t> columns;
  [[nodiscard]] bool has(std::size_t column) const;
};

/// `time_s`; else what the map says; else the one column that is called so (time, Zeit, ...), has
/// a unit of time, or holds dates or times of the clock.
/// @param map  may be nullptr
/// @return nullopt after a problem
[[nodiscard]] std::optional<TimeColumns> find_time(const TextTable& table, const ColumnMap* map,
                                                   const std::vector<std::string>& units,
                                                   ProblemList& problems);

struct RunTime {
  std::vector<double> time_s;  ///< increasing
  std::string said;            ///< what was understood
};

/// Dates, times of the clock and days count from the first row, other numbers from their own zero.
/// @param units  of each column, as written; empty: none
[[nodiscard]] RunTime read_time(const TextTable& table, const TimeColumns& time,
                                const ColumnMap* map, const std::vector<std::string>& units,
                                const NumberForm& form, ProblemList& problems);

}  // namespace thermocomp
