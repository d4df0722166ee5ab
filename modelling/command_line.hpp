/// The command line of `thermocomp-modelling`; `--help`, manual page and completion are made from
/// it.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp {

/// @param action  outlives the parsing, which sets it to what was asked for; it returns the exit
///                status
void declare_modelling_command_line(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp
