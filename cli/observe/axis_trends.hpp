/// How the offsets of the axes went lately, as a line of little bars and an arrow.
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <string>

#include "status/status.hpp"

namespace thermocomp::cli {

/// Remembers what one `watch` has seen.
class AxisTrends {
 public:
  static constexpr std::size_t cells = 16;
  static constexpr double window_s = 600.0;

  /// @param wide  whether the terminal shows more than ASCII
  explicit AxisTrends(bool wide) : wide_(wide) {}

  /// The status' uptime is the time.
  void add(const Status& status);
  /// "▁▂▃▅▇ ↗": the oldest left, as high as the window's range lets it; empty before two values.
  [[nodiscard]] std::string text(const std::string& axis) const;

 private:
  struct Sample {
    double time_s;
    double offset;
  };
  [[nodiscard]] std::string bars(const std::deque<Sample>& samples) const;
  [[nodiscard]] const char* arrow(const std::deque<Sample>& samples) const;

  bool wide_;
  std::map<std::string, std::deque<Sample>> axes_;
};

/// Whether the environment's locale is UTF-8.
[[nodiscard]] bool terminal_is_wide();

}  // namespace thermocomp::cli
