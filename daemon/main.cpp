// thermocompd: reads thermocouples, predicts how the machine bends, sends offsets to its
// controller.
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "config/text/clean_output.hpp"
#include "config/text/problems.hpp"
#include "daemon/command_line.hpp"
#include "daemon/daemon.hpp"
#include "daemon/system/log_setup.hpp"

int main(int argc, char** argv) {
  thermocomp::clean_standard_output();
  CLI::App app;
  std::string config_file = "/etc/thermocomp/thermocompd.toml";
  thermocomp::declare_daemon_command_line(app, config_file);
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
