/// What a model that was read without a problem must be good for.
#pragma once

#include "estimator/thermal_model.hpp"

namespace thermocomp::fuzz {

/// Every name and every number, bit for bit.
void check_same(const ThermalModel& a, const ThermalModel& b);
/// It can be built and stepped over ordinary and extreme temperatures.
void check_steps(const ThermalModel& model);

}  // namespace thermocomp::fuzz
