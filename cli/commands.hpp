/// The command line of `thermocomp`. `--help`, the manual page and the completion of the shell are
/// all made from what is declared here.
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

/// Name, description, options before the subcommand and every subcommand. Parsing sets `action`.
/// @param global, action  outlive the parsing and the action
void declare_command_line(CLI::App& app, GlobalOptions& global, Action& action);

// The groups of commands, each from its folder.

/// init: from a bare machine to a configuration that passes `check`.
void add_init_command(CLI::App& app, Action& action);
/// check: a daemon's configuration with its model, every problem at once.
void add_check_command(CLI::App& app, Action& action);
/// scan: every channel of a configuration, live and without the daemon.
void add_scan_command(CLI::App& app, Action& action);
/// status, sensors, watch: what the running daemon does.
void add_observe_commands(CLI::App& app, const GlobalOptions& global, Action& action);
/// reference, enable, disable, measured, cycle-end, reload, prove, promote: what an operator (or
/// the CNC's program) asks of the running daemon.
void add_operate_commands(CLI::App& app, const GlobalOptions& global, Action& action);
/// admit: models that the office offers.
void add_admit_command(CLI::App& app, Action& action);
/// export, replay: what the daemon's history holds, and whether it can be reproduced.
void add_history_commands(CLI::App& app, Action& action);
/// report: a machine's week from its history, as a page.
void add_report_command(CLI::App& app, Action& action);
/// import: logs of other programs as run files.
void add_import_command(CLI::App& app, Action& action);
/// predict, simulate: what a model says about a run, and runs of a machine that does not exist.
void add_model_commands(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
