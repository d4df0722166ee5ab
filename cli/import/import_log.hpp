/// One log, whatever its form, as a run file.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "cli/import/log_form.hpp"
#include "config/run_forms/column_map.hpp"
#include "config/run_forms/run_data.hpp"
#include "config/run_forms/time_column.hpp"

namespace thermocomp::cli {

struct ImportedLog {
  RunFile run;                        ///< `understood` says of every form how it was taken
  std::optional<WallZero> wall_zero;  ///< where the log has dates
};

/// @param map  what a person said about a table's columns; may be nullptr
/// @throws ConfigurationError with every problem, and the line to write where something is unclear
[[nodiscard]] ImportedLog import_log(const std::string& file, const ColumnMap* map,
                                     const LogOptions& options);
/// @param name  stands for the file in problems
[[nodiscard]] ImportedLog import_text(std::string_view text, const std::string& name,
                                      const ColumnMap* map, const LogOptions& options);

}  // namespace thermocomp::cli
