#include "modelling/command_line.hpp"

#include <cstdio>

#include <CLI/CLI.hpp>

#include "report/command.hpp"
#ifdef THERMOCOMP_WITH_STRUCTURE
#endif

namespace thermocomp {
namespace {

/// `structure` and `place`, which need CHOLMOD and Gmsh.
void add_structure(CLI::App& app, std::function<int()>& action) {
#ifdef THERMOCOMP_WITH_STRUCTURE
  structure::add_structure_command(app, action);
  placement::add_place_command(app, action);
#else
  constexpr int exit_error = 2;
  for (const char* name : {"structure", "place"}) {
    CLI::App* sub = app.add_subcommand(name, "not in this build");
    sub->prefix_command();
    sub->callback([name, &action] {
      action = [name] {
        std::fprintf(stderr, "thermocomp: built without '%s', which needs CHOLMOD and Gmsh\n",
                     name);
        return exit_error;
      };
    });
  }
#endif
}

/// Every text argument of these commands is a file or folder name, which completion needs to know.
void name_files(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    for (CLI::Option* option : command->get_options()) {
      if (option->get_type_name() == "TEXT") option->type_name("FILE");
    }
  }
}

}  // namespace

void declare_modelling_command_line(CLI::App& app, std::function<int()>& action) {
  app.name("thermocomp-modelling");
  app.description("Models: test plans, structures, sensor placement, fit, inspection, diagnosis");
  app.require_subcommand(1);
  app.failure_message(cli::command_error_text);
  // Shown by each command without a text of its own.
  app.footer("Exit status: 0 success, 2 usage error or bad input.");
  diagnosis::add_diagnose_command(app, action);
  inspection::add_inspect_command(app, action);
  add_structure(app, action);
  experiments::add_plan_command(app, action);
  identification::add_group_command(app, action);
  add_fit_command(app, action);
  series::add_series_command(app, action);
  identification::add_tiebar_command(app, action);
  thermal_test::add_thermal_test_command(app, action);
  name_files(app);
}

}  // namespace thermocomp
