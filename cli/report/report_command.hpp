/// `thermocomp report HISTORY.db -o REPORT.html`
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

void add_report_command(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
