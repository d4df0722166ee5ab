/// `thermocomp-fleet offer`, `approve` and `rollback`.
#pragma once

#include <string>

#include "report/command.hpp"

namespace thermocomp::fleet {

/// @param store  outlives the parsing, as does `action`
void add_release_commands(CLI::App& app, const std::string& store, cli::Action& action);

}  // namespace thermocomp::fleet
