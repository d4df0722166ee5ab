/// The command `thermocomp structure`.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::structure {

/// @param action  set if the command line selects this command; returns the exit status
void add_structure_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::structure
