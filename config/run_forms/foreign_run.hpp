/// Run files of other programs: any usual separator, decimal comma, dates, units in the header.
/// Nothing is guessed: an ambiguity is a problem that shows the line to add to the `--columns`
/// file. Rules: docs/run_files.md.
#pragma once

#include <string>
#include <string_view>

#include "config/run_forms/column_map.hpp"
#include "config/run_forms/run_data.hpp"

namespace thermocomp {

/// Whether a header row is in our own form: `time_s`, commas, and no unit in another spelling.
[[nodiscard]] bool is_own_form(std::string_view header);

/// Reads the whole file without a selection; `understood` describes how.
/// @param map  may be nullptr
/// @throws ConfigurationError with every problem (the first 100)
[[nodiscard]] RunFile read_foreign_run(std::string_view text, const std::string& name,
                                       const ColumnMap* map);

}  // namespace thermocomp
