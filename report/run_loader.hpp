/// The run files of one command: whatever form they have, and what was understood is reported once.
#pragma once

#include <string>
#include <vector>

#include "config/run_forms/column_map.hpp"
#include "config/runs/run_file.hpp"

namespace thermocomp::cli {

inline constexpr const char* columns_help =
    "what the columns of the run files are and how they are written (TOML), where the files do not "
    "say it";

class RunLoader {
 public:
  /// @param columns  file of `--columns`; empty: none
  /// @throws ConfigurationError
  explicit RunLoader(const std::string& columns);

  /// Reads RUN.csv[@T0:T1]. How a file that is not in our own form was read is reported on stderr,
  /// a line each; of further files that are alike only that they are.
  /// @throws ConfigurationError
  [[nodiscard]] RunFile load(const std::string& argument);
  [[nodiscard]] std::vector<RunFile> load(const std::vector<std::string>& arguments);

 private:
  void tell(const RunFile& run);

  bool has_map_;
  ColumnMap map_;
  std::vector<std::string> reported_;
};

}  // namespace thermocomp::cli
