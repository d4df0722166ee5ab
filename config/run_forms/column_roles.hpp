/// Columns that hold no values, but say how those of other columns are to be understood: their
/// unit, whether they are valid, which sensor a row is of, a part of the time.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/text_table.hpp"
#include "config/run_forms/time_column.hpp"

namespace thermocomp {

/// "Unit", "attributes.unit_of_measurement"
[[nodiscard]] bool names_units(std::string_view header);

/// "Sensor", "Channel": says which sensor a row is of.
[[nodiscard]] bool names_series(std::string_view header);

/// Rows whose values a column of qualities calls bad: words, or the numbers of OPC.
/// @return empty unless `column` holds qualities
[[nodiscard]] std::vector<bool> bad_rows(const TextTable& table, std::size_t column);

/// Writes the unit in a column behind one of numbers to each of these: 68.9 and °F become "68.9
/// °F".
void join_units(TextTable& table, const ColumnMap* map);

/// Empties the values that a column of qualities calls bad. Each such column judges the columns
/// between it and the one before it or, where the first column holds qualities, those behind it.
/// @return what was done; empty: the table has no qualities
[[nodiscard]] std::string leave_bad_values_out(TextTable& table, const TimeColumns& time,
                                               const ColumnMap* map);

/// Why a column cannot be left out or taken for a value without being asked for; empty: it can.
[[nodiscard]] std::string unclear_role(const TextTable& table, std::size_t column);

}  // namespace thermocomp
