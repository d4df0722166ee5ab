/// Which of the temperatures is the room's.
#pragma once

#include <string>
#include <vector>

#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis {

/// The first of the columns that is called like a room; empty: there is none.
[[nodiscard]] std::string room_among(const std::vector<std::string>& columns);

/// The room's temperature in a run: one that the model does not use, else one of its inputs; null:
/// none is named so.
[[nodiscard]] const Column* room_degC(const MeasuredData& data, const MeasuredRun& run);

}  // namespace thermocomp::diagnosis
