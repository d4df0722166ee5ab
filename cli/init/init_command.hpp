/// `thermocomp init`: from a bare machine to a configuration that passes `check`.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

void add_init_command(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
