#include "cli/commands.hpp"

#include "cli/check_command.hpp"
#include "cli/history_commands.hpp"
#include "cli/model_commands.hpp"
#include "cli/modelling_dispatch.hpp"
#include "cli/observe_commands.hpp"
#include "cli/operate_commands.hpp"

namespace thermocomp::cli {

void add_commands(CLI::App& app, const GlobalOptions& global, Action& action) {
  add_check_command(app, action);
  add_observe_commands(app, global, action);
  add_operate_commands(app, global, action);
  add_history_commands(app, action);
  add_model_commands(app, action);
  add_modelling_commands(app, action);
}

}  // namespace thermocomp::cli
