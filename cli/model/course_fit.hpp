/// Fits the gains of a correction to probed courses: the table `[course]` of a model.
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
  std::map<std::string, std::size_t> probings;  ///< by output; only those that changed a gain
  /// RMS displacement error at the points of runs left out in turn [um], by output: of gains from
  /// the other runs, and of gains of 1. Empty with one run.
  std::map<std::string, double> left_out_rms_um;
  std::map<std::string, double> without_rms_um;
};

/// Runs the daemon's correction over every run with at most one probing each `every_s`, and records
/// its gains at each state. The bandwidth is the best of 0.125, 0.25, 0.5 and 1 spreads on runs
/// left out in turn; with one run it is 0.5. Each output is thinned evenly to course_points_max.
/// @param model  its own course is not used
/// @throws ConfigurationError if a run lacks a column, or no run changes a gain
[[nodiscard]] CourseFit fit_course(std::span<const RunFile> runs, const ThermalModel& model,
                                   const CorrectionConfig& correction, double every_s);

}  // namespace thermocomp::cli
