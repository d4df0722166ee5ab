/// `thermocomp-fleet offer`, `approve` and `rollback`.
#pragma once

#include <string>

#include "report/command.hpp"

namespace thermocomp::fleet {

/// @param store, action  must outlive the parsing
void add_release_commands(CLI::App& app, const std::string& store, cli::Action& action);

}  // namespace thermocomp::fleet
