#include "fleet/command_line.hpp"

#include <CLI/CLI.hpp>

#include "fleet/night/night_command.hpp"
#include "fleet/release/release_commands.hpp"
#include "fleet/store/store_commands.hpp"
#include "report/command.hpp"

namespace thermocomp::fleet {

void declare_fleet_command_line(CLI::App& app, std::string& store, cli::Action& action) {
  app.name("thermocomp-fleet");
  app.description(
      "Manages the store of machines of one type: machines, nightly comparison, releases");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  app.require_subcommand(1);
  app.failure_message(cli::command_error_text);
  app.footer(
      "Exit status: 0 success, 1 refused, 2 usage error, bad input, or the store is unreachable.");
  store = "dbname=thermocomp_fleet";
  app.add_option(
         "--store", store,
         "connection to PostgreSQL in libpq's form: \"host=... dbname=...\" or a URL. Uses TLS "
         "and verifies the server's name, unless it contains sslmode=...")
      ->type_name("CONNECTION")
      ->envname("THERMOCOMP_FLEET_STORE")
      ->capture_default_str();
  add_store_commands(app, store, action);
  add_night_command(app, store, action);
  add_release_commands(app, store, action);
}

}  // namespace thermocomp::fleet
