/// status, sensors, watch: what the running daemon does.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

void add_observe_commands(CLI::App& app, const GlobalOptions& global, Action& action);

}  // namespace thermocomp::cli
