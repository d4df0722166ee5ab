/// The modelling subcommands, which a program of another package carries out.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

/// structure, place, tiebar, plan, inspect, group, fit, diagnose, thermal-test: all arguments go to
/// `thermocomp-modelling` beside this program, in its libexec folder or in PATH.
void add_modelling_commands(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
