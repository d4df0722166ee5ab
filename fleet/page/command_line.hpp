/// The command line of `thermocomp-fleet-page`; `--help`, manual page and completion are made from
/// it.
#pragma once

#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::fleet {

/// @param file  outlives the parsing, which sets it to the configuration's
void declare_page_command_line(CLI::App& app, std::string& file);

}  // namespace thermocomp::fleet
