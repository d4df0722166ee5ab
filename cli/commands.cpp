#include "cli/commands.hpp"

#include <CLI/CLI.hpp>

#include "cli/check/check_command.hpp"
#include "cli/history/history_commands.hpp"
#include "cli/import/import_command.hpp"
#include "cli/init/init_command.hpp"
#include "cli/model/model_commands.hpp"
#include "cli/model/modelling_dispatch.hpp"
#include "cli/observe/observe_commands.hpp"
#include "cli/operate/operate_commands.hpp"
#include "cli/report/report_command.hpp"
#include "cli/scan/scan_command.hpp"
#include "report/command_slip.hpp"

namespace thermocomp::cli {

void declare_command_line(CLI::App& app, GlobalOptions& global, Action& action) {
  app.name("thermocomp");
  app.description("Keeps a CNC machine straight while it warms: the command for its operator");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  app.add_option("--socket", global.socket, "the daemon's status socket")
      ->type_name("FILE")
      ->default_str(global.socket);
  app.require_subcommand(1);
  app.failure_message(command_slip_text);
  app.footer("Exit status: 0 success, 1 the answer is no, 2 bad use, bad input or unreachable.");
  add_init_command(app, action);
  add_check_command(app, action);
  add_scan_command(app, action);
  app.fallthrough();  // `thermocomp status --socket FILE` too
  add_observe_commands(app, global, action);
  add_operate_commands(app, global, action);
  app.fallthrough(false);
  add_history_commands(app, action);
  add_report_command(app, action);
  add_import_command(app, action);
  add_model_commands(app, action);
  add_modelling_commands(app, action);
}

}  // namespace thermocomp::cli
