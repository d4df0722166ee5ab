/// A fitted model in the frame of another one: so that the daemon's blocks and axes stay as they
/// are.
#pragma once

#include <string>
#include <vector>

#include "estimator/thermal_model.hpp"

namespace thermocomp::identification {

/// `fitted` with all inputs and outputs of `frame`, in its order, then those of its own: a place
/// that the fit does not use has the coefficient 0; an output that was not fitted keeps its row.
/// Terms and `[made_from]` are those of `fitted`.
/// @param notes  gets what a user should know: outputs that are kept or new, what is not taken over
/// @throws std::runtime_error when `frame` has terms, guideways or a course and an output that was
///         not fitted, which would lose them
[[nodiscard]] ThermalModel in_frame(const ThermalModel& fitted, const ThermalModel& frame,
                                    std::vector<std::string>& notes);

}  // namespace thermocomp::identification
