/// The covariance of a model's inputs, and how far estimates made with it go wrong, from records.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::cli {

struct CovarianceFit {
  std::vector<std::vector<double>> matrix_K2;  ///< shape (inputs, inputs)
  CovarianceGrowth growth;
  std::size_t rows{0};          ///< with all inputs, after averaging to one pitch
  double hours{0.0};            ///< that these rows stand for
  std::vector<double> sd_1h_K;  ///< one an input, of an estimate an hour after the loss of it alone
};

/// Matrix: the covariance about each run's own mean, since only changes are ever used. Growth: each
/// run is cut into halves; every half is left out once, each input is predicted in it from the
/// others with the covariance of all the rest, and the error's mean square change over times from
/// minutes to a third of a run,
///
///     mean (r(t + h) - r(t))^2  =  S_ii (d_i^2 g(h / drift_time) + s_i^2 g(h / scatter_time)),
///
/// is fitted (relative least squares; g = 1 - exp(-h), S_ii the conditional variance by the whole
/// covariance). Half a run is a handful of warm-ups, so the factors are widened by the ratio of the
/// 97.5 % points of Student's t with 3 degrees of freedom and of the normal distribution.
/// Rows outside a run's selection, and rows with a missing input, are left out.
/// @throws ConfigurationError when a run lacks an input, or there are too few rows in all
[[nodiscard]] CovarianceFit fit_covariance(std::span<const RunFile> runs,
                                           const std::vector<std::string>& inputs);

/// The text of a model file with its `[covariance]` table put in place of an old one, all else as
/// it stands where that is possible, comments too.
/// @param model  of the text, with the new covariance
[[nodiscard]] std::string with_covariance(const std::string& text, const ThermalModel& model);

}  // namespace thermocomp::cli
