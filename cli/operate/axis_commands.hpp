/// prove, release: requests for one axis, with their outcome.
#pragma once

#include <string>

#include "report/command.hpp"

namespace thermocomp::cli {

/// prove: moves the axis, monitors the move and prints the outcome. Progress on stderr: one line,
/// or without a terminal one every 2 s.
/// @return exit_success: moved as asked and came back; exit_no: otherwise
/// @throws ClientError, RemoteError
[[nodiscard]] int run_prove(const GlobalOptions& global, const std::string& axis, double move_um);

/// release: drives an axis with a latched mismatch again, subject to the next read-backs.
/// @return exit_success: driven again; exit_no: still latched, or no read-back within ten seconds
[[nodiscard]] int run_release(const GlobalOptions& global, const std::string& axis);

}  // namespace thermocomp::cli
