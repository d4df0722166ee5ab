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

/// `time_s`; else what the map says; else the one column that is called time, Zeit, ..., has a unit
/// of time, or holds dates or clock times.
/// @param map  may be nullptr
/// @return nullopt after a problem
[[nodiscard]] std::optional<TimeColumns> find_time(const TextTable& table, const ColumnMap* map,
                                                   const std::vector<std::string>& units,
                                                   ProblemList& problems);

/// When time_s was 0, by the clock that wrote the file.
struct WallZero {
  double seconds{0.0};  ///< since 1970, in UTC or the writer's zone
  bool is_utc{false};
};

struct RunTime {
  std::vector<double> time_s;         ///< increasing
  std::string said;                   ///< what was understood
  std::optional<WallZero> wall_zero;  ///< where the rows have dates
};

/// Dates, times of the clock and days count from the first row, other numbers from their own zero.
/// @param units  of each column, as written; empty: none
[[nodiscard]] RunTime read_time(const TextTable& table, const TimeColumns& time,
                                const ColumnMap* map, const std::vector<std::string>& units,
                                const NumberForm& form, ProblemList& problems);

}  // namespace thermocomp
