/// prove: moves an axis, watches it, and says what was read.
#pragma once

#include <string>

#include "report/command.hpp"

namespace thermocomp::cli {

/// Waits until the move is over; a line of progress where stderr is a terminal, else one every 2 s.
/// @return exit_success: moved as asked and came back; exit_no: what was read instead is said
/// @throws Failure as ask_daemon()
[[nodiscard]] int run_prove(const GlobalOptions& global, const std::string& axis, double move_um);

}  // namespace thermocomp::cli
