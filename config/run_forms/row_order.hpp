/// The order of a run's rows, and the clock at the begin and the end of summer time.
#pragma once

#include <vector>

#include "config/run_forms/run_data.hpp"
#include "config/run_forms/text_table.hpp"

namespace thermocomp {

/// Turns rows of falling times, and follows a local clock through the change of summer time.
/// @param time_s  of each row, from `run.wall_zero` on
/// @param run  gets the notes
void order_in_time(TextTable& table, std::vector<double>& time_s, RunFile& run);

}  // namespace thermocomp
