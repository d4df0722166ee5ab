/// What is wrong with a reading in one run, before the model makes anything of it.
#pragma once

#include <string>
#include <vector>

#include "modelling/diagnosis/measured_runs.hpp"

namespace thermocomp::diagnosis {

/// The first of the columns that is named room, ambient or air; empty: there is none.
[[nodiscard]] std::string room_among(const std::vector<std::string>& columns);

/// Error of a reading with a fault of gain 1, over all rows of the run:
///
///   sensor_step    1 from the onset on [K]
///   sensor_drift   time since the onset [h], for a gain in K/h
///   sensor_loose   room - reading from the onset on [K]; the room is a temperature that the model
///                  does not use, else one of its inputs, else the reading's first value
///
/// @param onset_s  the shape's one parameter
/// @pre the cause is one of these
[[nodiscard]] Column error_of_reading(const std::string& cause, const MeasuredData& data,
                                      const MeasuredRun& run, std::size_t input, double onset_s);

}  // namespace thermocomp::diagnosis
