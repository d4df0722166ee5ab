/// export, replay: what the daemon's history holds, and whether it can be reproduced.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

void add_history_commands(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
