/// Command line of `thermocomp-uplink`; `--help`, manual page and completion are generated from it.
#pragma once

#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::fleet {

struct UplinkOptions {
  std::string config_file{"/etc/thermocomp/uplink.toml"};
  bool once{false};
};

void declare_uplink_command_line(CLI::App& app, UplinkOptions& options);

}  // namespace thermocomp::fleet
