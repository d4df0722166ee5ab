/// Live table of `thermocomp watch`, as a terminal screen or as log lines, with the trends of the
/// offsets and the truth of a simulated machine.
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

class AxisTrends {
 public:
  static constexpr std::size_t cells = 16;
  static constexpr double window_s = 600.0;

  /// @param wide  the terminal shows Unicode
  explicit AxisTrends(bool wide) : wide_(wide) {}

  /// The sample's time is the status' uptime.
  void add(const Status& status);
  /// "▁▂▃▅▇ ↗": oldest sample left, scaled to the window's range; empty below two samples.
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

/// The environment's locale is UTF-8.
[[nodiscard]] bool terminal_is_wide();

/// True displacement that a simulated machine writes while it runs.
struct TruthRow {
  std::vector<std::string> columns;
  std::vector<double> first;   ///< values of the file's first row
  std::vector<double> values;  ///< of the newest row; NaN: missing
  /// @return the newest value of the column, NaN where there is none
  [[nodiscard]] double value(const std::string& column) const;
  /// @return its change since the first row
  [[nodiscard]] double change(const std::string& column) const;
};

/// Reads a CSV file to which another program appends.
class TruthFile {
 public:
  explicit TruthFile(std::filesystem::path path);
  /// The last complete row; nullptr before the first.
  [[nodiscard]] const TruthRow* newest();

 private:
  void take_line(const std::string& line);

  std::filesystem::path path_;
  std::ifstream file_;
  std::string unfinished_;  ///< the incomplete last line
  TruthRow row_;
};

/// A whole screen. @param truth  of a simulated machine; else nullptr
/// @param trends  nullptr: not shown
[[nodiscard]] std::string watch_screen(const Status& status, const TruthRow* truth, bool colours,
                                       const AxisTrends* trends = nullptr);
/// Two lines: heading of watch_line().
[[nodiscard]] std::string watch_header(const Status& status, const TruthRow* truth);
[[nodiscard]] std::string watch_line(const Status& status, const TruthRow* truth);

/// Log lines; repeats the heading when the truth appears or ends.
class WatchLog {
 public:
  [[nodiscard]] std::string next(const Status& status, const TruthRow* truth);

 private:
  std::optional<bool> has_truth_;  ///< of the last heading; empty: none yet
};

}  // namespace thermocomp::cli
