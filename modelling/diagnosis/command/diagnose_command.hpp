/// `thermocomp diagnose`.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::diagnosis {

/// @param action  set when the command line asks for this command; returns the exit status
void add_diagnose_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::diagnosis
