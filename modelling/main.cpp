// thermocomp-modelling: the subcommands of `thermocomp` that need more than a machine has.
#include <csignal>
#include <cstdio>
#include <exception>
#include <functional>

#include <CLI/CLI.hpp>

#include "config/text/clean_output.hpp"
#include "config/text/problems.hpp"
#include "modelling/command_line.hpp"

namespace {

constexpr int exit_bad_use = 2;

int run(int argc, char** argv) {
  CLI::App app;
  std::function<int()> action;
  thermocomp::declare_modelling_command_line(app, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : exit_bad_use;
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
  } catch (const std::exception& error) {
    std::fprintf(stderr, "thermocomp: %s\n", error.what());
  }
  return exit_bad_use;
}
