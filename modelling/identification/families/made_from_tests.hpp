/// What a fitted model was made from, as it is to stand in its file.
#pragma once

#include "estimator/thermal_model.hpp"
#include "modelling/identification/families/families_fit.hpp"

namespace thermocomp::identification {

/// Ranges, covariance and left-out errors of `fit.model`, without its own `made_from`.
[[nodiscard]] MadeFrom made_from_tests(const MeasuredTests& tests, const FamiliesFit& fit);

}  // namespace thermocomp::identification
