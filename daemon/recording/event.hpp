/// What happened, for a person: faults with their ends, changes of mode, what operators did.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

namespace thermocomp {

struct Event {
  std::uint64_t number{0};  ///< counts up from 1 in a run of the daemon
  std::int64_t wall_ns{0};  ///< since 1970
  std::string kind;         ///< "fault", "recovery", "mode", "command" or "daemon"
  std::string subject;      ///< "sensor bed_front", "bus cabinet", ...; mode: the one before
  std::string what;         ///< the fault (of a recovery: which has ended), the mode, the command
  /// recovery: how long the fault lasted; mode: how long the one before it did [s]. NaN: neither
  double duration_s{std::numeric_limits<double>::quiet_NaN()};
  std::int64_t user{-1};  ///< command: who gave it, by the kernel; -1: nobody, or SIGHUP
};

}  // namespace thermocomp
