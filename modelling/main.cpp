// thermocomp-modelling: the subcommands of `thermocomp` that need more than a machine has.
#include <csignal>
#include <cstdio>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

#include "config/text/problems.hpp"
#include "modelling/command_line.hpp"

namespace {

constexpr int exit_bad_use = 2;

/// A subcommand that `thermocomp` may know and this build does not.
void refuse_unknown(const CLI::App& app, const std::string& name) {
  if (name.front() == '-') return;  // an option
  std::string known;
  for (const CLI::App* sub : app.get_subcommands({})) {
    if (sub->get_name() == name) return;
    known.append(known.empty() ? "" : ", ").append(sub->get_name());
  }
  throw std::runtime_error("thermocomp-modelling has no command '" + name + "'; it has " + known);
}

int run(int argc, char** argv) {
  CLI::App app;
  std::function<int()> action;
  thermocomp::declare_modelling_command_line(app, action);
  if (argc > 1 && *argv[1] != '\0') refuse_unknown(app, argv[1]);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : exit_bad_use;
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
  } catch (const std::exception& error) {
    std::fprintf(stderr, "thermocomp: %s\n", error.what());
  }
  return exit_bad_use;
}
