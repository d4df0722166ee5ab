/// The live table of `thermocomp watch`, as a screen for a terminal or as lines for a log, and what
/// is remembered for it: how the offsets went, and the truth of a simulated machine.
#pragma once

#include <cstddef>
#include <deque>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

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

/// The truth that a simulated machine writes while it runs: what the tool really does.
struct TruthRow {
  std::vector<std::string> columns;
  std::vector<double> first;   ///< values of the file's first row
  std::vector<double> values;  ///< of the newest row; NaN: missing
  /// @return the newest value of the column, NaN where there is none
  [[nodiscard]] double value(const std::string& column) const;
  /// @return its change since the first row
  [[nodiscard]] double change(const std::string& column) const;
};

/// Follows a CSV file that another program appends to.
class TruthFile {
 public:
  explicit TruthFile(std::filesystem::path path);
  /// The last whole row written so far; nullptr while there is none.
  [[nodiscard]] const TruthRow* newest();

 private:
  void take_line(const std::string& line);

  std::filesystem::path path_;
  std::ifstream file_;
  std::string unfinished_;  ///< the line being written at the moment
  TruthRow row_;
};

/// A whole screen. @param truth  what the tool really does, where it is simulated; else nullptr
/// @param trends  how the offsets went; nullptr: not shown
[[nodiscard]] std::string watch_screen(const Status& status, const TruthRow* truth, bool colours,
                                       const AxisTrends* trends = nullptr);
/// Two lines: what the columns of watch_line() are.
[[nodiscard]] std::string watch_header(const Status& status, const TruthRow* truth);
[[nodiscard]] std::string watch_line(const Status& status, const TruthRow* truth);

/// Lines for a log, below a heading that stands again where the truth appears or goes.
class WatchLog {
 public:
  [[nodiscard]] std::string next(const Status& status, const TruthRow* truth);

 private:
  std::optional<bool> has_truth_;  ///< below the last heading; empty: before the first
};

}  // namespace thermocomp::cli
