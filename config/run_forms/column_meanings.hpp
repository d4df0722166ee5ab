/// Meaning of each column of a foreign table, by its name, its content and the map of --columns: a
/// quantity in a unit, or a statement on the values of other columns (their unit, their validity,
/// the sensor of a row).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_table.hpp"

namespace thermocomp {

/// "Unit", "attributes.unit_of_measurement"
[[nodiscard]] bool names_units(std::string_view header);

/// "Sensor", "Channel": says which sensor a row is of.
[[nodiscard]] bool names_series(std::string_view header);

/// Whether no field is a number or a switch.
[[nodiscard]] bool is_text(const TextColumn& column);

/// Rows whose values a column of qualities calls bad: words, or the numbers of OPC.
/// @return empty unless `column` holds qualities
[[nodiscard]] std::vector<bool> bad_rows(const TextColumn& column);

/// Reads the units of columns from the header, the row of units, or the cells.
void read_units(TextTable& table);

/// Writes the unit in a column behind one of numbers to each of these: 68.9 and °F become "68.9
/// °F".
void join_units(TextTable& table);

/// Empties the values that a column of qualities calls bad, and notes it. Each such column judges
/// the columns between it and the one before it or, where the first column holds qualities, those
/// behind it.
void leave_bad_values_out(TextTable& table);

/// Why a column cannot be left out or taken for a value without being asked for; empty: it can.
[[nodiscard]] std::string unclear_role(const TextColumn& column);

struct ColumnMeaning {
  const TextColumn* source{nullptr};
  std::string name;  ///< in a run file of our own form: "T1_degC"
  UnitConversion conversion;
};

/// Meanings of the columns that hold values. Refused columns become problems; notes name the
/// columns left out and the assumptions made.
[[nodiscard]] std::vector<ColumnMeaning> column_meanings(TextTable& table);

}  // namespace thermocomp
