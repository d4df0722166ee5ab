// thermocomp-modelling: the subcommands of `thermocomp` that need more than a machine has.
#include <csignal>
#include <cstdio>
#include <exception>
#include <functional>

#include <CLI/CLI.hpp>

#include "config/problems.hpp"
#include "modelling/diagnosis/diagnose_command.hpp"
#ifdef THERMOCOMP_WITH_STRUCTURE
#include "modelling/structure/structure_command.hpp"
#endif

namespace {

constexpr int exit_bad_use = 2;

void add_structure(CLI::App& app, std::function<int()>& action) {
#ifdef THERMOCOMP_WITH_STRUCTURE
  thermocomp::structure::add_structure_command(app, action);
#else
  CLI::App* sub = app.add_subcommand("structure", "not in this build");
  sub->prefix_command();
  sub->callback([&action] {
    action = [] {
      std::fprintf(stderr, "thermocomp: built without 'structure', which needs CHOLMOD and Gmsh\n");
      return exit_bad_use;
    };
  });
#endif
}

int run(int argc, char** argv) {
  CLI::App app("thermocomp-modelling: what leads to a model, and what a model gets wrong");
  app.require_subcommand(1);
  std::function<int()> action;
  thermocomp::diagnosis::add_diagnose_command(app, action);
  add_structure(app, action);
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
