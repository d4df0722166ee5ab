/// Set-up of the daemon's log: destination and level.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace thermocomp {

/// Logs to the journal if started by systemd, else to standard error, from a separate thread: the
/// caller never waits for the reader.
void set_up_log();
/// @param level  trace, debug, info, warning, error
void set_log_level(const std::string& level);

/// Statistics of the queue. When it is full, the oldest lines are dropped; their number is logged
/// once the sink accepts lines again.
struct LogStatistics {
  std::uint64_t dropped{0};  ///< since the start
  bool is_stalled{false};    ///< lines are being dropped
};
[[nodiscard]] LogStatistics log_statistics();

/// Waits until all lines are handed over. @return true if they are
bool flush_log(std::chrono::milliseconds at_most);

}  // namespace thermocomp
