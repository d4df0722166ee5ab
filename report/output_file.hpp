/// The file that `-o` names: complete or not there at all.
#pragma once

#include <filesystem>
#include <fstream>
#include <ostream>
#include <string>

namespace thermocomp::cli {

/// Writes beside the destination and renames on commit(); without commit() nothing is left, also
/// when the program is interrupted. `-` is standard output; a pipe that is read, the terminal and
/// /dev/null are written directly, other devices refused.
/// One at a time in a program.
class OutputFile {
 public:
  explicit OutputFile(const std::string& destination);  ///< @throws Failure
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  [[nodiscard]] std::ostream& stream() noexcept { return *stream_; }
  /// @throws Failure when not everything could be written
  void commit();

 private:
  void refuse_what_hangs() const;
  void open_temporary();

  std::string name_;                   ///< as given, for messages
  std::filesystem::path destination_;  ///< with links resolved
  std::filesystem::path temporary_;    ///< empty: written directly
  std::ofstream file_;
  std::ostream* stream_;
};

/// @throws Failure
void write_file(const std::string& destination, const std::string& text);

}  // namespace thermocomp::cli
