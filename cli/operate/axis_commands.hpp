/// prove, release: what is asked of one axis and waited for.
#pragma once

#include <string>

#include "report/command.hpp"

namespace thermocomp::cli {

/// prove: moves the axis, watches it until the move is over, and says what was read. A line of
/// progress where stderr is a terminal, else one every 2 s.
/// @return exit_success: moved as asked and came back; exit_no: what was read instead is said
/// @throws Failure as ask_daemon()
[[nodiscard]] int run_prove(const GlobalOptions& global, const std::string& axis, double move_um);

/// release: an axis with a latched mismatch is driven again. Waits for what the next read-backs
/// say.
/// @return exit_success: driven again; exit_no: it stays latched, or nothing was read back within
///         ten seconds
[[nodiscard]] int run_release(const GlobalOptions& global, const std::string& axis);

}  // namespace thermocomp::cli
