/// The command line of `thermocompd`; `--help`, manual page and completion are made from it.
#pragma once

#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp {

/// @param config_file  outlives the parsing; its value is the default
void declare_daemon_command_line(CLI::App& app, std::string& config_file);

}  // namespace thermocomp
