// thermocomp-modelling: the subcommands of `thermocomp` that a machine's controller does not need.
#include "modelling/command_line.hpp"
#include "report/command.hpp"

int main(int argc, char** argv) {
  return thermocomp::cli::run_program(argc, argv, "thermocomp",
                                      thermocomp::declare_modelling_command_line);
}
