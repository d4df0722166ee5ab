// thermocomp: command line for operators and engineers.
#include "cli/commands.hpp"
#include "cli/common/daemon_client.hpp"

int main(int argc, char** argv) {
  using namespace thermocomp::cli;
  GlobalOptions global{default_socket()};
  return run_program(argc, argv, "thermocomp", [&](CLI::App& app, Action& action) {
    declare_command_line(app, global, action);
  });
}
