// thermocompd: reads temperatures, predicts the thermal displacement, sends offsets.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "config/text/clean_output.hpp"
#include "config/text/problems.hpp"
#include "daemon/command_line.hpp"
#include "daemon/daemon.hpp"
#include "daemon/system/log_setup.hpp"

namespace {

constexpr std::chrono::seconds log_patience{1};

/// Prints after the log is flushed; if the log's reader hangs, standard error may also block.
void complain(const std::string& what) {
  if (thermocomp::flush_log(log_patience)) std::fprintf(stderr, "%s\n", what.c_str());
}

int run(const std::string& config_file) {
  try {
    thermocomp::Daemon daemon(config_file);
    daemon.run();
  } catch (const thermocomp::ConfigurationError& error) {
    complain(error.what());
    return 2;
  } catch (const std::exception& error) {
    complain(std::string("thermocompd: ") + error.what());
    return 1;
  }
  return 0;
}

}  // namespace

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
  const int status = run(config_file);
  // exit() would flush the log and block while its reader hangs.
  if (!thermocomp::flush_log(log_patience)) std::_Exit(status);
  return status;
}
