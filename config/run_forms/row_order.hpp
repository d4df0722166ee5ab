/// The order of a run's rows, and the clock at the begin and the end of summer time.
#pragma once

#include "config/run_forms/time_column.hpp"

namespace thermocomp {

/// Turns rows of falling times, follows a local clock through the change of summer time, and
/// refuses a time that does not increase.
/// @param column  of the time, shown in the problem
void order_in_time(TextTable& table, RunTime& time, std::size_t column);

}  // namespace thermocomp
