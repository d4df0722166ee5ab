/// Command line of `thermocomp`. Also the source of `--help`, manual page and shell completion.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

/// Declares the global options and all subcommands. Parsing sets `action`.
/// @param global, action  must outlive parsing and the action
void declare_command_line(CLI::App& app, GlobalOptions& global, Action& action);

/// init: creates a configuration that passes `check` by asking and scanning.
void add_init_command(CLI::App& app, Action& action);
/// check: reports every problem of a daemon's configuration and its model at once.
void add_check_command(CLI::App& app, Action& action);
/// scan: reads every channel of a configuration live, without the daemon.
void add_scan_command(CLI::App& app, Action& action);
/// status, sensors, watch: show the state of the running daemon.
void add_observe_commands(CLI::App& app, const GlobalOptions& global, Action& action);
/// reference, enable, disable, measured, cycle-end, reload, prove, promote: requests to the running
/// daemon.
void add_operate_commands(CLI::App& app, const GlobalOptions& global, Action& action);
/// admit: checks and runs models that the office offers.
void add_admit_command(CLI::App& app, Action& action);
/// export, replay: convert the daemon's history, and verify that it can be reproduced.
void add_history_commands(CLI::App& app, Action& action);
/// report: HTML report of a machine's week from its history.
void add_report_command(CLI::App& app, Action& action);
/// import: converts logs of other programs to run files.
void add_import_command(CLI::App& app, Action& action);
/// predict, simulate: apply a model to a run; generate runs of a simulated machine.
void add_model_commands(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
