/// `thermocomp import LOG -o RUN.csv`
#pragma once

#include "report/command.hpp"

namespace thermocomp::cli {

void add_import_command(CLI::App& app, Action& action);

}  // namespace thermocomp::cli
