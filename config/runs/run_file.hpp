/// Run files: measured or simulated data, CSV with one header row; the unit is in the column's name
/// (config/text/units.hpp). An empty field or `nan` is a missing value. One file is one run. Our
/// programs write this form; others (run_forms/foreign_run.hpp) can be read.
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

/// `FILE`, `FILE@T0:T1`, `FILE@T0:`, `FILE@:T1`. An `@` without a later `:` is part of the name.
/// @throws ConfigurationError when a bound is not a number or T0 >= T1
[[nodiscard]] RunSelection parse_selection(std::string_view argument);

/// The file name, with `@T0:T1` for a selection; parse_selection() parses it.
[[nodiscard]] std::string selected_name(const RunFile& run);

/// Requires at least one row, a strictly increasing time_s, and a selection that is not empty.
/// @param map  form of other programs' files; may be nullptr. Ignored for a file of our own form
///             if it names no column of that file.
/// @throws ConfigurationError with every problem (the first 100), each with line, column and rule
[[nodiscard]] RunFile load_run(const RunSelection& selection, const ColumnMap* map = nullptr);
/// @param name  file name in problems; `selection.file` is not used
[[nodiscard]] RunFile parse_run(std::string_view text, const std::string& name,
                                const RunSelection& selection = {}, const ColumnMap* map = nullptr);

/// The file of a run or of a part of one.
[[nodiscard]] std::filesystem::path file_of(const RunFile& run);

/// The stretches between references, each a run with references and lags of its own, named
/// FILE@T0:T1; those without a selected row are omitted.
[[nodiscard]] std::vector<RunFile> between_references(const RunFile& run);

/// All rows as a run file, every number bit for bit; missing values are empty fields.
[[nodiscard]] std::string write_run(const RunFile& run);

}  // namespace thermocomp
