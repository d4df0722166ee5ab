/// What the other sensors say of a supposed fault of one reading.
#pragma once

#include "modelling/diagnosis/evidence.hpp"

namespace thermocomp::diagnosis {

/// The reading is predicted from the other temperatures and the signals, each with lags; the fault
/// that the displacement asks for must be seen in what is left of it.
/// @return 2 ln of the likelihood ratio of the reading with the fault to the one without; positive:
///         the sensors confirm it
[[nodiscard]] double sensor_says(const MeasuredData& data, const StackedRows& rows,
                                 const Explanation& fault);

}  // namespace thermocomp::diagnosis
