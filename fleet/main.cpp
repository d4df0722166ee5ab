// thermocomp-fleet: what an office does with the store of its machines.
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "config/text/clean_output.hpp"
#include "config/text/problems.hpp"
#include "fleet/command_line.hpp"
#include "report/command.hpp"

namespace {

using namespace thermocomp;

int run(int argc, char** argv) {
  CLI::App app;
  std::string store;
  cli::Action action;
  fleet::declare_fleet_command_line(app, store, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? cli::exit_success : cli::exit_bad_use;
  }
  return action();
}

}  // namespace

int main(int argc, char** argv) {
  clean_standard_output();
  std::signal(SIGPIPE, SIG_IGN);  // a closed pipe is an error of writing, reported as one
  try {
    return run(argc, argv);
  } catch (const ConfigurationError& error) {
    std::fprintf(stderr, "%s\n", error.what());
  } catch (const cli::Failure& failure) {
    std::fprintf(stderr, "thermocomp-fleet: %s\n", failure.what());
    return failure.status();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "thermocomp-fleet: %s\n", error.what());
  }
  return cli::exit_bad_use;
}
