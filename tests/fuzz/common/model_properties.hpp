/// Promises of a model that was read without a problem.
#pragma once

#include "estimator/thermal_model.hpp"

namespace thermocomp::fuzz {

/// Compares every name and every number bit for bit.
void check_same(const ThermalModel& a, const ThermalModel& b);
/// Builds the model and steps it over ordinary and extreme temperatures.
void check_steps(const ThermalModel& model);

}  // namespace thermocomp::fuzz
