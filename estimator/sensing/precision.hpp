/// The precision matrix of the model's inputs: what the expectation of each from the others needs.
#pragma once

#include <vector>

#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// (C + noise^2 I)^-1 of the model's covariance, row by row; allocates.
/// @throws InvalidValue when the matrix or the growth of its errors does not fit the model
[[nodiscard]] std::vector<double> precision_per_K2(const ThermalModel& model);

/// 1 - exp(-age / time); 1 where it is grown at once.
[[nodiscard]] double grown(double age_s, double time_s) noexcept;

[[nodiscard]] double drift_factor(const CovarianceGrowth& growth, std::size_t input) noexcept;
[[nodiscard]] double scatter_factor(const CovarianceGrowth& growth, std::size_t input) noexcept;

}  // namespace thermocomp
