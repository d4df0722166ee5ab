/// The quantity and unit of each column of a foreign table, by its name, its units, and the map of
/// --columns.
#pragma once

#include <string>
#include <vector>

#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_table.hpp"

namespace thermocomp {

struct ColumnMeaning {
  const TextColumn* source{nullptr};
  std::string name;  ///< in a run file of our own form: "T1_degC"
  UnitConversion conversion;
};

/// Of the columns that hold values. Refused columns become problems; notes say what was left out or
/// taken for granted.
[[nodiscard]] std::vector<ColumnMeaning> column_meanings(TextTable& table);

}  // namespace thermocomp
