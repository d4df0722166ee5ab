#include "fleet/uplink/command_line.hpp"

#include <CLI/CLI.hpp>

namespace thermocomp::fleet {

void declare_uplink_command_line(CLI::App& app, UplinkOptions& options) {
  app.name("thermocomp-uplink");
  app.description("Sends thermocompd's history to the store of a series of machines");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  app.add_option("CONFIG", options.config_file, "the configuration (TOML)")
      ->type_name("FILE")
      ->capture_default_str();
  app.add_flag("--once", options.once, "ends when all recorded data has been sent");
  app.footer(
      "Runs in the foreground until SIGTERM or SIGINT. Unsent data stays in the history and is\n"
      "sent later.\n"
      "Exit status: 0 stopped on request, 1 with --once: not all data was sent, 2 usage error or "
      "bad configuration.");
}

}  // namespace thermocomp::fleet
