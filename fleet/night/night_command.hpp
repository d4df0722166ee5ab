/// `thermocomp-fleet night`: compares each machine's past days with sisters and own past.
#pragma once

#include <string>

#include "report/command.hpp"

namespace thermocomp::fleet {

/// @param store, action  must outlive the parsing
void add_night_command(CLI::App& app, const std::string& store, cli::Action& action);

}  // namespace thermocomp::fleet
