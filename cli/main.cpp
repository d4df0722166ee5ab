// thermocomp: command line for operators and engineers.
#include <cstdlib>

#include "cli/commands.hpp"
#include "config/daemon/daemon_config.hpp"

int main(int argc, char** argv) {
  using namespace thermocomp;
  const char* chosen = std::getenv("THERMOCOMP_SOCKET");
  const bool is_chosen = chosen != nullptr && *chosen != '\0';
  cli::GlobalOptions global{is_chosen ? chosen : SocketConfig{}.path.string()};
  return cli::run_program(argc, argv, "thermocomp", [&](CLI::App& app, cli::Action& action) {
    cli::declare_command_line(app, global, action);
  });
}
