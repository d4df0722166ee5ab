#include "gateway/command_line.hpp"

#include <CLI/CLI.hpp>

namespace thermocomp::gateway {

void declare_gateway_command_line(CLI::App& app, GatewayOptions& options) {
  app.name("thermocomp-gateway");
  app.description(
      "Publishes the status of thermocompd: a page for browsers, metrics for Prometheus, MQTT, an "
      "MTConnect "
      "adapter, alarms");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  app.add_option("CONFIG", options.config_file, "the configuration (TOML)")
      ->type_name("FILE")
      ->capture_default_str();
  app.add_option("--password-line", options.password_user,
                 "reads a password from standard input and prints this user's line for the file in "
                 "http.passwords")
      ->type_name("USER");
  app.add_flag(
      "--device-file", options.device_file,
      "prints the device file for the MTConnect agent, with the daemon's sensors and axes");
  app.footer(
      "Runs in the foreground until SIGTERM or SIGINT; once it serves it prints a line of JSON "
      "with\n"
      "its ports. Check a configuration with: thermocomp check.\n"
      "Exit status: 0 stopped on request, 1 failed to start or continue, 2 usage error or "
      "configuration.");
}

}  // namespace thermocomp::gateway
