#include "daemon/command_line.hpp"

#include <CLI/CLI.hpp>

namespace thermocomp {

void declare_daemon_command_line(CLI::App& app, std::string& config_file) {
  app.name("thermocompd");
  app.description(
      "Compensates the thermal displacement of a machine tool: thermocouples in, axis offsets out");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  app.add_option("CONFIG", config_file, "the configuration (TOML)")
      ->type_name("FILE")
      ->capture_default_str();
  app.footer(
      "Runs in the foreground until SIGTERM or SIGINT; SIGHUP reloads. Logs to the journal when\n"
      "started by systemd, else to standard error. Check a configuration with: thermocomp check.\n"
      "Exit status: 0 stopped on request, 1 failed to start or continue, 2 usage error or "
      "configuration.");
}

}  // namespace thermocomp
