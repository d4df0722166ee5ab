/// What an inspection says of a recording.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace thermocomp::inspection {

/// One thing that is not as it should be. `kind` is one of spikes, sensor_step, sensor_drift,
/// sensor_loose, sensor_swap, stuck, coarse, copy, displacement_step, outliers, gap, clock.
struct Finding {
  std::string kind;
  std::string column;  ///< empty: the run as a whole
  std::string other;   ///< the second column of a copy or an exchange; all further ones of a gap
  std::size_t run{0};
  double at_s{0.0};
  double until_s{0.0};
  double size{0.0};  ///< in `unit`; see the kind in docs/inspection.md
  std::string unit;
  double probability{0.0};
  double score{0.0};            ///< what the probability was made from
  std::string text;             ///< for the machine's owner
  std::vector<double> times_s;  ///< of spikes and outliers
};

struct RunSampling {
  std::string file;
  std::size_t rows{0};
  double step_s{0.0};                           ///< median from row to row
  std::vector<std::pair<double, double>> gaps;  ///< without a row, or of a column
};

struct Inspection {
  std::vector<RunSampling> runs;
  std::vector<std::vector<std::string>> groups;       ///< places that move alike, largest first
  std::vector<std::pair<std::string, bool>> excited;  ///< signals: varied enough to be told apart
  std::vector<std::string> experiments;               ///< what would tell more
  std::vector<Finding> findings;                      ///< likeliest first
};

}  // namespace thermocomp::inspection
