/// `thermocomp scan`: every channel of a configuration, live and without the daemon.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

void add_scan_command(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
