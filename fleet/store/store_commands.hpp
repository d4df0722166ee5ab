/// `thermocomp-fleet init`, `add` and `status`.
#pragma once

#include <string>

#include "report/command.hpp"

namespace thermocomp::fleet {

/// @param store, action  must outlive the parsing
void add_store_commands(CLI::App& app, const std::string& store, cli::Action& action);

}  // namespace thermocomp::fleet
