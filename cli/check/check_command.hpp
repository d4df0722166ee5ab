/// check: a daemon's configuration with its model, every problem at once.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

void add_check_command(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
