/// Command line of `thermocomp-fleet-page`, also the source of manual page and completion.
#pragma once

#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::fleet {

/// @param file  set to the configuration file; must outlive the parsing
void declare_page_command_line(CLI::App& app, std::string& file);

}  // namespace thermocomp::fleet
