// thermocomp-fleet: office commands for the store of a series of machines.
#include <string>

#include "fleet/command_line.hpp"
#include "report/command.hpp"

int main(int argc, char** argv) {
  using namespace thermocomp;
  std::string store;
  return cli::run_program(argc, argv, "thermocomp-fleet", [&](CLI::App& app, cli::Action& action) {
    fleet::declare_fleet_command_line(app, store, action);
  });
}
