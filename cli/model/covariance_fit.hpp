/// Fits to records the covariance of a model's inputs and the errors of lost inputs' estimates.
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
  std::size_t rows{0};          ///< complete rows after averaging to equal pitch
  double hours{0.0};            ///< duration of these rows
  std::vector<double> sd_1h_K;  ///< by input: error of its estimate an hour after its loss
};

/// Matrix: the covariance about each run's own mean, since only changes are used. Growth: each run
/// is cut into halves. Every half is left out once and each input is predicted in it from the
/// others by the covariance of the rest. The mean square change of the prediction error r over
/// times h from minutes to a third of a run,
///
///     mean (r(t + h) - r(t))^2  =  S_ii (d_i^2 g(h / drift_time) + s_i^2 g(h / scatter_time)),
///
/// is fitted by relative least squares; g = 1 - exp(-h), S_ii is the conditional variance from the
/// whole covariance. Half a run contains only a few warm-ups, so the factors are multiplied by the
/// ratio of the 97.5 % points of Student's t with 3 degrees of freedom and of the normal
/// distribution. Uses complete rows within each run's selection.
/// @throws ConfigurationError if a run lacks an input, or there are too few rows in all
[[nodiscard]] CovarianceFit fit_covariance(std::span<const RunFile> runs,
                                           const std::vector<std::string>& inputs);

/// Replaces the `[covariance]` table in the text of a model file; keeps the rest if possible.
/// @param model  model of the text, with the new covariance
[[nodiscard]] std::string with_covariance(const std::string& text, const ThermalModel& model);

}  // namespace thermocomp::cli
