/// Tables of one row per value, with the name of the series beside it: Grafana, Home Assistant,
/// InfluxDB, historians.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/time_column.hpp"

namespace thermocomp {

/// "x", "Z", "c": one letter of a linear or a rotary axis.
[[nodiscard]] constexpr bool is_axis_letter(std::string_view name) noexcept {
  constexpr std::string_view letters = "xyzabcXYZABC";
  return name.size() == 1 && letters.find(name.front()) != std::string_view::npos;
}

struct LongForm {
  std::vector<std::size_t> names;  ///< columns whose words together name the series
  std::size_t value{0};
  std::optional<std::size_t> unit;
};

/// What `pivot` of the map says; else a column of numbers called value, or one whose times repeat
/// or go back, beside columns of words that recur; else a single column of numbers beside one of
/// nothing but axes.
/// @param time_s  of each row
/// @return nullopt when the table is a wide one
[[nodiscard]] std::optional<LongForm> long_form(const TextTable& table, const TimeColumns& time,
                                                const std::vector<double>& time_s,
                                                const ColumnMap* map, ProblemList& problems);

/// A column a series, a row a time; what a series does not have at that time is empty.
/// @return what was done
std::string pivot(TextTable& table, std::vector<double>& time_s, const LongForm& form,
                  ProblemList& problems);

}  // namespace thermocomp
