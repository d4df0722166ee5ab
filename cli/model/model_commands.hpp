/// predict, simulate: what a model says about a run, and runs of a machine that does not exist.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

void add_model_commands(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
