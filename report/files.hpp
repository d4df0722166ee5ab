/// Files of a command: runs that it reads; the output of `-o`, written completely or not at all.
#pragma once

#include <filesystem>
#include <fstream>
#include <ostream>
#include <string>
#include <vector>

#include "config/run_forms/column_map.hpp"
#include "config/runs/run_file.hpp"

namespace thermocomp::cli {

inline constexpr const char* columns_help =
    "meaning and format of the run files' columns, as far as the files do not define them (TOML)";

/// Loads the run files of a command, in any form, and reports once how they were read.
class RunLoader {
 public:
  /// @param columns  file of `--columns`; may be empty
  /// @throws ConfigurationError
  explicit RunLoader(const std::string& columns);

  /// Reads RUN.csv[@T0:T1]. Reports on stderr how a file in a foreign form was read, one line per
  /// item; for further files of the same form, one line only.
  /// @throws ConfigurationError
  [[nodiscard]] RunFile load(const std::string& argument);
  /// One run per stretch between two references of a daemon's export.
  [[nodiscard]] std::vector<RunFile> load(const std::vector<std::string>& arguments);

 private:
  void print_interpretation(const RunFile& run);

  bool has_map_;
  ColumnMap map_;
  std::vector<std::string> reported_;
};

/// Writes beside the destination and renames in commit(); without commit() nothing is left, even
/// after an interrupt. `-` is standard output. A pipe with a reader, the terminal and /dev/null are
/// written directly; other devices are refused. One at a time per program.
class OutputFile {
 public:
  explicit OutputFile(const std::string& destination);  ///< @throws Failure
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  [[nodiscard]] std::ostream& stream() noexcept { return *stream_; }
  /// @throws Failure on a write error
  void commit();

 private:
  void refuse_what_hangs() const;
  void open_temporary();

  std::string name_;                   ///< for messages
  std::filesystem::path destination_;  ///< links resolved
  std::filesystem::path temporary_;    ///< empty: written directly
  std::ofstream file_;
  std::ostream* stream_;
};

/// @throws Failure
void write_file(const std::string& destination, const std::string& text);

}  // namespace thermocomp::cli
