/// `thermocomp promote`: the candidate becomes the model.
#pragma once

#include <CLI/CLI.hpp>

#include "report/command.hpp"

namespace thermocomp::cli {

void add_candidate_command(CLI::App& app, const GlobalOptions& global, Action& action);
void add_promote_command(CLI::App& app, const GlobalOptions& global, Action& action);

}  // namespace thermocomp::cli
