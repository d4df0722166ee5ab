/// Long tables, with one row per value and the name of its series: Grafana, Home Assistant,
/// InfluxDB, historians.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/time_column.hpp"

namespace thermocomp {

/// "x", "Z", "c": the letter of a linear or rotary axis.
[[nodiscard]] constexpr bool is_axis_letter(std::string_view name) noexcept {
  constexpr std::string_view letters = "xyzabcXYZABC";
  return name.size() == 1 && letters.find(name.front()) != std::string_view::npos;
}

struct LongForm {
  std::vector<std::size_t> names;  ///< columns whose words together name the series
  std::size_t value{0};
  std::optional<std::size_t> unit;
};

/// According to `pivot` of the map; else a column of numbers called value, or one whose times
/// repeat or decrease, with columns of recurring words; else a single column of numbers with one of
/// axis letters only.
/// @param time_s  of each row
/// @return nullopt when the table is a wide one
[[nodiscard]] std::optional<LongForm> long_form(const TextTable& table, const TimeColumns& time,
                                                const std::vector<double>& time_s,
                                                const ColumnMap* map, ProblemList& problems);

/// Makes one column per series and one row per time; missing values and those of bad quality are
/// empty.
/// @param scan_s  times within it of a row's first time belong to that row
/// @return a note on the change
std::string pivot(TextTable& table, const TimeColumns& time, std::vector<double>& time_s,
                  const LongForm& form, double scan_s, ProblemList& problems);

}  // namespace thermocomp
