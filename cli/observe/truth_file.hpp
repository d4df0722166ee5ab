/// The truth that a simulated machine writes while it runs: what the tool really does.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace thermocomp::cli {

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

}  // namespace thermocomp::cli
