/// Run files as people have them: any usual separator, decimal comma, dates, units in the header.
/// Nothing is guessed: what is ambiguous is a problem that shows the line to write in the file of
/// `--columns`. docs/run_files.md has the rules.
#pragma once

#include <string>
#include <string_view>

#include "config/run_forms/column_map.hpp"
#include "config/run_forms/run_data.hpp"

namespace thermocomp {

/// Whether a file's header row is in the form that programs write: `time_s` between commas, and no
/// name with a unit in another spelling.
[[nodiscard]] bool is_own_form(std::string_view header);

/// The whole file; `understood` says line by line how it was taken. Nothing is selected yet.
/// @param map  may be nullptr
/// @throws ConfigurationError with every problem (the first 100)
[[nodiscard]] RunFile read_foreign_run(std::string_view text, const std::string& name,
                                       const ColumnMap* map);

}  // namespace thermocomp
