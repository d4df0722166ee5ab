/// `thermocomp-fleet night`: every machine's day that is over, compared with its sisters and with
/// its own past, by ordinary modelling commands.
#pragma once

#include <string>

#include "report/command.hpp"

namespace thermocomp::fleet {

/// @param store  outlives the parsing, as does `action`
void add_night_command(CLI::App& app, const std::string& store, cli::Action& action);

}  // namespace thermocomp::fleet
