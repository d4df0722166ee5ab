// thermocomp: the command for operator and engineer. Thin: every command is a few lines over
// configuration, estimator, history, simulator or the daemon's status socket.
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "cli/commands.hpp"
#include "cli/common/daemon_client.hpp"
#include "config/text/clean_output.hpp"
#include "config/text/problems.hpp"
#include "report/command.hpp"

namespace {

using namespace thermocomp::cli;

int run(int argc, char** argv) {
  CLI::App app;
  GlobalOptions global{default_socket()};
  Action action;
  declare_command_line(app, global, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? exit_success : exit_bad_use;
  }
  return action();
}

}  // namespace

int main(int argc, char** argv) {
  thermocomp::clean_standard_output();
  std::signal(SIGPIPE, SIG_IGN);  // a closed pipe is an error of writing, reported as one
  try {
    return run(argc, argv);
  } catch (const thermocomp::ConfigurationError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return exit_bad_use;
  } catch (const Failure& failure) {
    std::fprintf(stderr, "thermocomp: %s\n", failure.what());
    return failure.status();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "thermocomp: %s\n", error.what());
    return exit_bad_use;
  }
}
