/// Command line of `thermocomp-gateway`, the source of `--help` and the manual page.
#pragma once

#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::gateway {

struct GatewayOptions {
  std::string config_file{"/etc/thermocomp/gateway.toml"};
  std::string password_user;  ///< --password-line; empty: not given
  bool device_file{false};    ///< --device-file
};

/// @param options  must outlive the parsing; its values are the defaults
void declare_gateway_command_line(CLI::App& app, GatewayOptions& options);

}  // namespace thermocomp::gateway
