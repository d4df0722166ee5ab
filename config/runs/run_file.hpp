/// Run files: measured or simulated data, CSV with one header row; the unit is in the column's name
/// (config/text/units.hpp). An empty field or `nan` is a missing value. One file is one run. That
/// is the form that programs write; what people have (run_forms/foreign_run.hpp) is read too.
#pragma once

#include <filesystem>
#include <limits>
#include <string>
#include <string_view>

#include "config/run_forms/run_data.hpp"
#include "config/text/problems.hpp"

namespace thermocomp {

struct ColumnMap;

/// `FILE@T0:T1`: the rows with `from_s <= time_s < to_s`.
struct RunSelection {
  std::filesystem::path file;
  double from_s{-std::numeric_limits<double>::infinity()};
  double to_s{std::numeric_limits<double>::infinity()};
};

/// `FILE`, `FILE@T0:T1`, `FILE@T0:`, `FILE@:T1`. An `@` that no `:` follows belongs to the name.
/// @throws ConfigurationError when a bound is not a number or T0 < T1 does not hold
[[nodiscard]] RunSelection parse_selection(std::string_view argument);

/// The file, with `@T0:T1` where not all of its rows are selected; parse_selection() reads it back.
[[nodiscard]] std::string selected_name(const RunFile& run);

/// At least one row; time_s present and strictly increasing. A selection without rows is refused.
/// @param map  what a person said about files of other forms; nullptr: nothing. A file of our own
///             form of which it names no column is read without it.
/// @throws ConfigurationError with every problem (the first 100), each with line, column and rule
[[nodiscard]] RunFile load_run(const RunSelection& selection, const ColumnMap* map = nullptr);
/// @param name stands for the file in problems; `selection.file` is not looked at
[[nodiscard]] RunFile parse_run(std::string_view text, const std::string& name,
                                const RunSelection& selection = {}, const ColumnMap* map = nullptr);

/// All rows as a run file, every number bit for bit; missing values are empty fields.
[[nodiscard]] std::string write_run(const RunFile& run);

}  // namespace thermocomp
