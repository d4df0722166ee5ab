/// thermocomp release: an axis with a latched mismatch is driven again.
#pragma once

#include <string>

#include "report/command.hpp"

namespace thermocomp::cli {

/// Asks for it and waits for what the next read-backs say.
/// @return 0: driven again; 1: it stays latched, or nothing was read back within ten seconds
int run_release(const GlobalOptions& global, const std::string& axis);

}  // namespace thermocomp::cli
