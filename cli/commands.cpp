#include "cli/commands.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <string>
#include <vector>

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

namespace thermocomp::cli {
namespace {

/// Letters to insert, remove or exchange.
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (const char letter : a) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t exchanged = diagonal + (letter == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({exchanged, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

/// A slip in a command's name, by that name; anything else as the library says it.
std::string failure_text(const CLI::App* app, const CLI::Error& error) {
  const std::vector<std::string> rest = app->remaining();
  const auto word = std::find_if(rest.begin(), rest.end(),
                                 [](const std::string& each) { return !each.starts_with('-'); });
  if (word == rest.end() || !app->get_subcommands().empty())
    return CLI::FailureMessage::simple(app, error);
  std::string nearest;
  std::size_t least = 3;  // more are another word
  for (const CLI::App* command : app->get_subcommands([](const CLI::App*) { return true; })) {
    const std::size_t here = distance(*word, command->get_name());
    if (here >= least || here >= word->size()) continue;
    least = here;
    nearest = command->get_name();
  }
  return "thermocomp: no command " + *word +
         (nearest.empty() ? "" : "; did you mean " + nearest + "?") +
         "\nthermocomp --help lists them.\n";
}

}  // namespace

void declare_command_line(CLI::App& app, GlobalOptions& global, Action& action) {
  app.name("thermocomp");
  app.description("Keeps a CNC machine straight while it warms: the command for its operator");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  app.add_option("--socket", global.socket, "the daemon's status socket")
      ->type_name("FILE")
      ->default_str(global.socket);
  app.require_subcommand(1);
  app.failure_message(failure_text);
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
