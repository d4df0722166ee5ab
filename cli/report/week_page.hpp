/// The report on a machine's week: a page for its owner.
#pragma once

#include <string>
#include <vector>

#include "cli/report/machine_week.hpp"

namespace thermocomp::cli {

/// What to do, most important first; empty: nothing.
[[nodiscard]] std::vector<std::string> advice(const MachineWeek& week);
[[nodiscard]] std::string week_html(const MachineWeek& week);

}  // namespace thermocomp::cli
