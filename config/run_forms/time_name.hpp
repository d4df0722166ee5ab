/// Names of columns that hold the time.
#pragma once

#include <optional>
#include <string_view>

namespace thermocomp {

/// "Zeit", "elapsed time", "timestamp [ms]"
[[nodiscard]] bool names_time(std::string_view header);

/// Names that are usual for dates, also as numbers with an epoch.
[[nodiscard]] bool names_date(std::string_view header);

/// The unit at the end of a time column's name, "time_ms"; empty: none.
[[nodiscard]] std::string_view unit_of_time_name(std::string_view header);

/// "Date Time, GMT+01:00": time zone of the column.
[[nodiscard]] std::optional<double> zone_of_header(std::string_view header);

}  // namespace thermocomp
