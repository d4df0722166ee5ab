#include "fleet/uplink/command_line.hpp"

#include <CLI/CLI.hpp>

namespace thermocomp::fleet {

void declare_uplink_command_line(CLI::App& app, UplinkOptions& options) {
  app.name("thermocomp-uplink");
  app.description("Sends what thermocompd has recorded to the store of a series of machines");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  app.add_option("CONFIG", options.config_file, "the configuration (TOML)")
      ->type_name("FILE")
      ->capture_default_str();
  app.add_flag("--once", options.once, "ends once all that is recorded has been sent");
  app.footer(
      "Runs in the foreground until SIGTERM or SIGINT. The history is the buffer: what could not "
      "be "
      "sent\n"
      "is sent later.\n"
      "Exit status: 0 stopped on request, 1 with --once: not all was sent, 2 usage error or "
      "configuration.");
}

}  // namespace thermocomp::fleet
