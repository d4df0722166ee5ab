/// Where the daemon's log goes, and how much is logged.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace thermocomp {

/// The journal when systemd started us, else standard error. A thread of its own hands the lines
/// over: whoever logs never waits for a pipe that nobody reads or a journal that stands.
void set_up_log();
/// @param level  trace, debug, info, warning, error
void set_log_level(const std::string& level);

/// Lines that nobody took while there was room for no more; the oldest of them are dropped. How
/// many it were is logged as soon as the log flows again.
struct LogStatistics {
  std::uint64_t dropped{0};  ///< since the start
  bool stands{false};        ///< lines are being dropped
};
[[nodiscard]] LogStatistics log_statistics();

/// Waits until all that was logged is handed over. @return whether it is
bool flush_log(std::chrono::milliseconds at_most);

}  // namespace thermocomp
