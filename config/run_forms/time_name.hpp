/// By which names and numbers a column shows that it holds the time.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

namespace thermocomp {

/// "Zeit", "elapsed time", "timestamp [ms]"
[[nodiscard]] bool names_time(std::string_view header);

/// Names that are usual for dates, also as numbers with an epoch.
[[nodiscard]] bool names_date(std::string_view header);

/// The unit at the end of a time column's name, "time_ms"; empty: none.
[[nodiscard]] std::string_view unit_of_time_name(std::string_view header);

/// "Date Time, GMT+01:00": time zone of the column.
[[nodiscard]] std::optional<double> zone_of_header(std::string_view header);

/// What numbers count from.
struct Epoch {
  const char* name;
  double low;  ///< the range is the years 2001 to about 2050
  double high;
  double per_second;
  double zero_s;    ///< since 1970
  bool only_named;  ///< small, hence ambiguous: the column must be called date or time
  bool is_utc;
};

/// The epoch that the size of a column's numbers shows.
/// @param is_named  the column is called date or time, or has a unit of time
/// @param has_unit  else numbers of which no two are within an hour may be a counter of another
/// unit
/// @return nullptr: none
[[nodiscard]] const Epoch* epoch_of(const std::vector<double>& numbers, bool is_named,
                                    bool has_unit);

}  // namespace thermocomp
