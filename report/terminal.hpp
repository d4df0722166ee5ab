/// What a person in front of a terminal gets and a pipe does not: colours, a line of progress.
#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace thermocomp::cli {

[[nodiscard]] bool stdout_is_terminal() noexcept;
[[nodiscard]] bool stderr_is_terminal() noexcept;

enum class Colour { none, green, yellow, red, bold };
/// @return `text` between the terminal's codes of `colour`; plain when `on` is false
[[nodiscard]] std::string coloured(std::string_view text, Colour colour, bool on);

/// `text` from the first column on, in the place of what the line shows.
[[nodiscard]] std::string rewritten_line(std::string_view text);

/// One line on stderr, overwritten, for work of more than 2 s; nothing where stderr is no terminal.
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();  ///< takes the line away
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// @param fraction  of the work done, 0..1; outside: not known
  void update(double fraction);

 private:
  std::string what_;
  std::chrono::steady_clock::time_point began_;
  std::chrono::steady_clock::time_point shown_;
  bool on_terminal_;
  bool visible_{false};
};

/// For long work in steps: what begins, with the time since the start, a line each on stderr.
class ProgressLines {
 public:
  void say(std::string_view what) const;

 private:
  std::chrono::steady_clock::time_point began_{std::chrono::steady_clock::now()};
};

}  // namespace thermocomp::cli
