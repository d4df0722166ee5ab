/// Report on a machine's week, as a page for its owner.
#pragma once

#include <string>
#include <vector>

#include "cli/report/machine_week.hpp"

namespace thermocomp::cli {

/// Recommended actions, most important first.
[[nodiscard]] std::vector<std::string> advice(const MachineWeek& week);
[[nodiscard]] std::string week_html(const MachineWeek& week);

}  // namespace thermocomp::cli
