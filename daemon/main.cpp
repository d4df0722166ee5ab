// thermocompd: reads thermocouples, predicts how the machine bends, sends offsets to its
// controller.
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "config/problems.hpp"
#include "daemon/daemon.hpp"
#include "daemon/log_setup.hpp"

int main(int argc, char** argv) {
  CLI::App app{
      "Compensates the thermal displacement of a machine tool: thermocouples in, axis offsets out"};
  app.name("thermocompd");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  std::string config_file = "/etc/thermocomp/thermocompd.toml";
  app.add_option("CONFIG", config_file, "the configuration (TOML)")->capture_default_str();
  app.footer(
      "Runs in the foreground until SIGTERM or SIGINT; SIGHUP reloads. Logs to the journal when\n"
      "started by systemd, else to standard error. Check a configuration with: thermocomp check.\n"
      "Exit status: 0 stopped as asked, 1 could not start or go on, 2 bad use or configuration.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  thermocomp::set_up_log();
  try {
    thermocomp::Daemon daemon(config_file);
    daemon.run();
  } catch (const thermocomp::ConfigurationError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "thermocompd: %s\n", error.what());
    return 1;
  }
  return 0;
}
