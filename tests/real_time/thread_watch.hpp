/// Counts a thread's allocations, locks, page faults and system calls.
#pragma once

#include <cstdint>

namespace thermocomp::test {

struct ThreadCounts {
  std::uint64_t allocations{0};
  std::uint64_t locks{0};
  std::uint64_t system_calls{0};  ///< other than sleeping and reading the clock
  std::int64_t page_faults{0};
};

/// Starts counting for the calling thread. Once per process.
void begin_watch();
/// Stops counting; on the same thread.
[[nodiscard]] ThreadCounts end_watch();

}  // namespace thermocomp::test
