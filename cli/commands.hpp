/// The command line of `thermocomp`. `--help`, the manual page and the completion of the shell are
/// all made from what is declared here.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

/// Name, description, options before the subcommand and every subcommand. Parsing sets `action`.
/// @param global, action  outlive the parsing and the action
void declare_command_line(CLI::App& app, GlobalOptions& global, Action& action);

}  // namespace thermocomp::cli
