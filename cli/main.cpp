// thermocomp: the command for operator and engineer. Thin: every command is a few lines over
// configuration, estimator, history, simulator or the daemon's status socket.
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "cli/daemon_client.hpp"
#include "config/problems.hpp"

namespace {

using namespace thermocomp::cli;

int run(int argc, char** argv) {
  CLI::App app{"Keeps a CNC machine straight while it warms: the command for its operator"};
  app.name("thermocomp");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  GlobalOptions global{default_socket()};
  app.add_option("--socket", global.socket, "the daemon's status socket")
      ->default_str(global.socket);
  app.require_subcommand(1);
  app.footer("Exit status: 0 success, 1 the answer is no, 2 bad use, bad input or unreachable.");
  Action action;
  add_commands(app, global, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? exit_success : exit_bad_use;
  }
  return action();
}

}  // namespace

int main(int argc, char** argv) {
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
