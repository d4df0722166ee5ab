#include "fleet/page/command_line.hpp"

#include <CLI/CLI.hpp>

namespace thermocomp::fleet {

void declare_page_command_line(CLI::App& app, std::string& file) {
  app.name("thermocomp-fleet-page");
  app.description("Serves a web page of the machines of a store, for phone and desktop");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  file = "/etc/thermocomp/fleet_page.toml";
  app.add_option("CONFIG", file, "the configuration (TOML)")
      ->type_name("FILE")
      ->capture_default_str();
  app.footer(
      "Exit status: 0 stopped on request, 2 usage error, bad configuration, or the port is in "
      "use.");
}

}  // namespace thermocomp::fleet
