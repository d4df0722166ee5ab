/// How far the parameters of a finding may be from what they are given as.
#pragma once

#include "modelling/diagnosis/rank/fits.hpp"

namespace thermocomp::diagnosis {

/// Sets the intervals of 95 %: every value of a shape parameter whose likelihood, the gains fitted
/// anew, is within reach of the best one's; the gains at these values with their own deviation.
void set_spread(const Fits& fits, Finding& finding);

}  // namespace thermocomp::diagnosis
