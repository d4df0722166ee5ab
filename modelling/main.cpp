// thermocomp-modelling: the subcommands of `thermocomp` that need more than a machine has.
#include <csignal>
#include <cstdio>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

#include "config/problems.hpp"
#include "modelling/diagnosis/diagnose_command.hpp"
#ifdef THERMOCOMP_WITH_STRUCTURE
#include "modelling/placement/place_command.hpp"
#include "modelling/structure/structure_command.hpp"
#endif

namespace {

constexpr int exit_bad_use = 2;

/// `structure` and `place`, which need CHOLMOD and Gmsh.
void add_structure(CLI::App& app, std::function<int()>& action) {
#ifdef THERMOCOMP_WITH_STRUCTURE
  thermocomp::structure::add_structure_command(app, action);
  thermocomp::placement::add_place_command(app, action);
#else
  for (const char* name : {"structure", "place"}) {
    CLI::App* sub = app.add_subcommand(name, "not in this build");
    sub->prefix_command();
    sub->callback([name, &action] {
      action = [name] {
        std::fprintf(stderr, "thermocomp: built without '%s', which needs CHOLMOD and Gmsh\n",
                     name);
        return exit_bad_use;
      };
    });
  }
#endif
}

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
  CLI::App app("thermocomp-modelling: what leads to a model, and what a model gets wrong");
  app.require_subcommand(1);
  std::function<int()> action;
  thermocomp::diagnosis::add_diagnose_command(app, action);
  add_structure(app, action);
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
