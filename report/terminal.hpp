/// Output for terminals, not for pipes: colours and a progress line.
#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace thermocomp::cli {

[[nodiscard]] bool stdout_is_terminal() noexcept;
[[nodiscard]] bool stderr_is_terminal() noexcept;

enum class Colour { none, green, yellow, red, bold };
/// @return `text` in the terminal's `colour`; plain if `on` is false
[[nodiscard]] std::string coloured(std::string_view text, Colour colour, bool on);

/// `text` from the first column on, replacing the line.
[[nodiscard]] std::string rewritten_line(std::string_view text);

/// A progress line on stderr for work of more than 2 s; nothing if stderr is not a terminal.
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();  ///< removes the line
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// @param fraction  of the work, 0..1; outside: unknown
  void update(double fraction);

 private:
  std::string what_;
  std::chrono::steady_clock::time_point began_;
  std::chrono::steady_clock::time_point shown_;
  bool on_terminal_;
  bool visible_{false};
};

/// Progress of long work in steps: one line per step on stderr, with the time since the start.
class ProgressLines {
 public:
  void print(std::string_view what) const;

 private:
  std::chrono::steady_clock::time_point began_{std::chrono::steady_clock::now()};
};

}  // namespace thermocomp::cli
