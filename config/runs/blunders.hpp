/// Finds flaws of runs: displacements that no structure can show (a probe that missed, a row read
/// wrong), and rows that are used twice.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"

namespace thermocomp {

/// Those of one column of a run.
struct Blunders {
  std::string column;
  std::vector<double> times_s;
  double size_um{0.0};   ///< the largest, with its sign
  double limit_um{0.0};  ///< beyond which a value is one
  bool stuck{false};     ///< the same value again and again; size_um: of the leap after it

  /// One line: how many, of what, when and how far off.
  [[nodiscard]] std::string text() const;
};

/// A value is a blunder that stands off the median of its neighbours (four on each side; at an end
/// off the straight line through those of its one side) by more than twelve usual deviations from
/// that median and a quarter (at an end half) of the way that the column goes. A step is none: the
/// values after it agree with each other. Stuck are ten rows or more of one value, three times as
/// long as any other such stretch, that end with a leap beyond twelve usual changes of a row and a
/// quarter of the way.
/// @param columns  of displacement or tilt
[[nodiscard]] std::vector<Blunders> find_blunders(const RunFile& run,
                                                  const std::vector<std::string>& columns);

/// The same, and each becomes a missing value.
std::vector<Blunders> leave_out_blunders(RunFile& run, const std::vector<std::string>& columns);

/// Whether both are of the same file and some row is selected in both. Files are the same when
/// their names lead to the same place.
[[nodiscard]] bool share_rows(const RunFile& a, const RunFile& b);

/// Runs that are to be left out in turn, or one to be judged by another, must not share rows.
/// @throws ConfigurationError naming the file
void refuse_overlap(std::span<const RunFile> runs);
/// Rows that a model is fitted to, and rows that it is judged on.
void refuse_overlap(std::span<const RunFile> train, std::span<const RunFile> test);

}  // namespace thermocomp
