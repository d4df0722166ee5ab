/// Every subcommand of `thermocomp`.
#pragma once

#include "cli/command.hpp"

namespace thermocomp::cli {

void add_commands(CLI::App& app, const GlobalOptions& global, Action& action);

}  // namespace thermocomp::cli
