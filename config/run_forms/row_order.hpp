/// The rows of a table: one per time, in its order. Long tables (Grafana, Home Assistant, InfluxDB,
/// historians) have one row per value and the name of its series.
#pragma once

#include <string_view>

#include "config/run_forms/time_column.hpp"

namespace thermocomp {

/// "x", "Z", "c": the letter of a linear or rotary axis.
[[nodiscard]] constexpr bool is_axis_letter(std::string_view name) noexcept {
  constexpr std::string_view letters = "xyzabcXYZABC";
  return name.size() == 1 && letters.find(name.front()) != std::string_view::npos;
}

/// Makes one column per series of a long table; missing values and those of bad quality are empty.
/// A table is long if the map has `pivot`. Otherwise it must have a column of numbers called value,
/// or one whose times repeat or decrease, and columns of recurring words; or only a column of
/// numbers and one of axis letters. Times within `scan_s` of a row's first time belong to that row.
///
/// Then turns rows of falling times, follows a local clock through the change of summer time, and
/// refuses a time that does not increase.
/// @param columns  that `time` was read from
void order_rows(TextTable& table, RunTime& time, const TimeColumns& columns);

}  // namespace thermocomp
