/// Results of an inspection of recordings.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace thermocomp::inspection {

/// A fault of a recording. `kind` is one of spikes, sensor_step, sensor_drift, sensor_loose,
/// sensor_swap, stuck, coarse, unit, noise, copy, displacement_step, outliers, gap, clock.
struct Finding {
  std::string kind;
  std::string column;  ///< empty: the run as a whole
  std::string other;   ///< second column of a copy or exchange; further columns of a gap
  std::size_t run{0};
  double at_s{0.0};
  double until_s{0.0};
  double size{0.0};  ///< in `unit`; see the kind in docs/inspection.md
  std::string unit;
  double probability{0.0};
  double score{0.0};            ///< basis of the probability
  std::string text;             ///< for the machine's owner
  std::vector<double> times_s;  ///< of spikes and outliers
};

struct RunSampling {
  std::string file;
  std::size_t rows{0};
  double step_s{0.0};                           ///< median from row to row
  std::vector<std::pair<double, double>> gaps;  ///< without rows, or without values of a column
};

struct Inspection {
  std::vector<RunSampling> runs;
  std::vector<std::vector<std::string>> groups;  ///< places that move alike, largest group first
  std::vector<std::pair<std::string, bool>> excited;  ///< signals: varied enough to be identified
  std::vector<std::string> experiments;               ///< proposed experiments
  std::vector<Finding> findings;                      ///< most probable first
};

}  // namespace thermocomp::inspection
