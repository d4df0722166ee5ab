/// reference, enable, disable, measured, cycle-end, reload, prove: what an operator (or the CNC's
/// program) asks of the running daemon.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

void add_operate_commands(CLI::App& app, const GlobalOptions& global, Action& action);

}  // namespace thermocomp::cli
