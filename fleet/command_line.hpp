/// Command line of `thermocomp-fleet`; `--help`, manual page and completion are generated from it.
#pragma once

#include <functional>
#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::fleet {

/// @param store, action  must outlive the parsing, which sets them to the connection and to the
///               requested command; the command returns the exit status
void declare_fleet_command_line(CLI::App& app, std::string& store, std::function<int()>& action);

}  // namespace thermocomp::fleet
