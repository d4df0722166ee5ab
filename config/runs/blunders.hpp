/// Finds flaws of runs: outliers of displacement (a missed probe, a misread row); common rows.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"

namespace thermocomp {

/// Outliers of one column of a run.
struct Blunders {
  std::string column;
  std::vector<double> times_s;
  double size_um{0.0};   ///< the largest deviation, with its sign
  double limit_um{0.0};  ///< limit of the deviation
  bool stuck{false};     ///< one value repeated; size_um: jump after it

  /// One line with number, column, times and size.
  [[nodiscard]] std::string text() const;
};

/// An outlier deviates from the median of its neighbours (four on each side; at an end from a
/// robust line through its neighbours) by more than twelve robust standard deviations and a quarter
/// (at an end half) of the column's range. A step is not an outlier, since the values after it
/// agree. A column is stuck at ten rows or more of one value, three times as many as in any other
/// such stretch, that end with a jump beyond twelve robust standard deviations of the changes
/// between rows and a quarter of the range.
/// @param columns  of displacement or tilt
[[nodiscard]] std::vector<Blunders> find_blunders(const RunFile& run,
                                                  const std::vector<std::string>& columns);

/// The same, and sets the outliers to missing.
std::vector<Blunders> leave_out_blunders(RunFile& run, const std::vector<std::string>& columns);

/// Whether both are of the same file (resolved path) and have a selected row in common.
[[nodiscard]] bool share_rows(const RunFile& a, const RunFile& b);

/// Refuses common rows of runs that are left out in turn or judge one another.
/// @throws ConfigurationError naming the file
void refuse_overlap(std::span<const RunFile> runs);
/// Refuses common rows of training and test runs.
void refuse_overlap(std::span<const RunFile> train, std::span<const RunFile> test);

}  // namespace thermocomp
