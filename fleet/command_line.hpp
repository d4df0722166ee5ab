/// The command line of `thermocomp-fleet`; `--help`, manual page and completion are made from it.
#pragma once

#include <functional>
#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::fleet {

/// @param store   outlives the parsing, which sets it to the store's connection
/// @param action  outlives the parsing, which sets it to what was asked for; it returns the exit
///                status
void declare_fleet_command_line(CLI::App& app, std::string& store, std::function<int()>& action);

}  // namespace thermocomp::fleet
