/// Meaning of each column of a foreign table, from its name, its content and the map of --columns:
/// a quantity in a unit, or data about the values of other columns (unit, validity, sensor of a
/// row).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_table.hpp"

namespace thermocomp {

/// "Unit", "attributes.unit_of_measurement"
[[nodiscard]] bool names_units(std::string_view header);

/// "Sensor", "Channel": names the sensor of each row.
[[nodiscard]] bool names_series(std::string_view header);

/// Whether no field is a number or a switch.
[[nodiscard]] bool is_text(const TextColumn& column);

/// Rows whose values a column of qualities marks as bad: words, or the numbers of OPC.
/// @return empty unless `column` holds qualities
[[nodiscard]] std::vector<bool> bad_rows(const TextColumn& column);

/// Reads the units of columns from the header, the row of units, or the cells.
void read_units(TextTable& table);

/// Appends the unit in the column after a column of numbers to each number: 68.9 and °F become
/// "68.9 °F".
void join_units(TextTable& table);

/// Empties the values that a column of qualities marks as bad, and notes it. Each such column
/// applies to the columns between it and the previous one or, if the first column holds qualities,
/// to those after it.
void leave_bad_values_out(TextTable& table);

/// Reason why a column needs a decision by the user: it can neither be left out nor taken for a
/// value. Empty: none.
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
