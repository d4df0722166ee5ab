/// Loads the run files of a command, in any form, and reports once how they were read.
#pragma once

#include <string>
#include <vector>

#include "config/run_forms/column_map.hpp"
#include "config/runs/run_file.hpp"

namespace thermocomp::cli {

inline constexpr const char* columns_help =
    "meaning and format of the run files' columns, as far as the files do not define them (TOML)";

class RunLoader {
 public:
  /// @param columns  file of `--columns`; may be empty
  /// @throws ConfigurationError
  explicit RunLoader(const std::string& columns);

  /// Reads RUN.csv[@T0:T1]. Reports on stderr how a file in a foreign form was read, one line per
  /// item; for further files of the same form only that they are.
  /// @throws ConfigurationError
  [[nodiscard]] RunFile load(const std::string& argument);
  [[nodiscard]] std::vector<RunFile> load(const std::vector<std::string>& arguments);

 private:
  void print_interpretation(const RunFile& run);

  bool has_map_;
  ColumnMap map_;
  std::vector<std::string> reported_;
};

}  // namespace thermocomp::cli
