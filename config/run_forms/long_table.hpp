/// Long tables, with one row per value and the name of its series: Grafana, Home Assistant,
/// InfluxDB, historians.
#pragma once

#include <string_view>
#include <vector>

#include "config/run_forms/text_table.hpp"

namespace thermocomp {

/// "x", "Z", "c": the letter of a linear or rotary axis.
[[nodiscard]] constexpr bool is_axis_letter(std::string_view name) noexcept {
  constexpr std::string_view letters = "xyzabcXYZABC";
  return name.size() == 1 && letters.find(name.front()) != std::string_view::npos;
}

/// Makes one column per series and one row per time of a long table; missing values and those of
/// bad quality are empty. A table is long according to `pivot` of the map; else with a column of
/// numbers called value, or one whose times repeat or decrease, with columns of recurring words;
/// else with a single column of numbers and one of axis letters only. Times within `scan_s` of a
/// row's first time belong to that row.
/// @param time_s  of each row
/// @return false: the table is a wide one, unchanged
bool pivot_long_table(TextTable& table, std::vector<double>& time_s);

}  // namespace thermocomp
