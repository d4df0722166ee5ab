/// A fitted model in the frame of another one: so that the daemon's blocks and axes stay as they
/// are.
#pragma once

#include "estimator/thermal_model.hpp"

namespace thermocomp::identification {

/// `fitted` with all inputs and outputs of `frame`, in its order, then those of its own: a place
/// that the fit does not use has the coefficient 0; an output that was not fitted keeps its row.
/// Terms and
/// `[made_from]` are those of `fitted`.
/// @throws std::runtime_error when `frame` has terms, guideways, a course or a covariance, which
///         could not be kept
[[nodiscard]] ThermalModel in_frame(const ThermalModel& fitted, const ThermalModel& frame);

}  // namespace thermocomp::identification
