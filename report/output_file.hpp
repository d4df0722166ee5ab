/// The output file of `-o`: written completely or not at all.
#pragma once

#include <filesystem>
#include <fstream>
#include <ostream>
#include <string>

namespace thermocomp::cli {

/// Writes beside the destination and renames in commit(); without commit() nothing is left, also
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
