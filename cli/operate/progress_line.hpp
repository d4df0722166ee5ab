/// What a command waits for, on stderr.
#pragma once

#include <chrono>
#include <string>

namespace thermocomp::cli {

/// The line of progress: one that is overwritten, or one every two seconds where stderr is no
/// terminal.
class ProgressLine {
 public:
  explicit ProgressLine(std::string what);
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void update(const std::string& text);

 private:
  std::string what_;
  bool on_terminal_;
  bool shown_{false};
  std::chrono::steady_clock::time_point last_;
};

}  // namespace thermocomp::cli
