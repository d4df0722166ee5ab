/// Where the daemon's log goes, and how much is logged.
#pragma once

#include <string>

namespace thermocomp {

/// The journal when systemd started us, else standard error.
void set_up_log();
/// @param level  trace, debug, info, warning, error
void set_log_level(const std::string& level);

}  // namespace thermocomp
