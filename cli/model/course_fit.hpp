/// What probed courses teach about the gains of a correction: the table `[course]` of a model.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>

#include "config/runs/run_file.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::cli {

struct CourseFit {
  RecordedCourse course;
  std::map<std::string, std::size_t> probings;  ///< of each output, that taught something
  /// RMS over the points of runs left out in turn [um], by output: displacement that the gains of
  /// the other runs, and gains of 1, miss. Empty with one run.
  std::map<std::string, double> left_out_rms_um;
  std::map<std::string, double> without_rms_um;
};

/// Lets the correction learn from every run as the daemon would, a probing at most each `every_s`,
/// and notes its gains at each state. The bandwidth is the best of 0.125, 0.25, 0.5 and 1 spreads
/// on runs left out in turn, 0.5 where there is one run. More than course_points_max points of an
/// output are thinned out evenly.
/// @param model  its own course is not used
/// @throws ConfigurationError when a run lacks a column, or no run teaches anything
[[nodiscard]] CourseFit fit_course(std::span<const RunFile> runs, const ThermalModel& model,
                                   const CorrectionConfig& correction, double every_s);

}  // namespace thermocomp::cli
