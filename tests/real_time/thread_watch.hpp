/// Watches one thread from within: what it allocates, locks, faults in and asks of the kernel.
#pragma once

#include <cstdint>

namespace thermocomp::test {

struct ThreadCounts {
  std::uint64_t allocations{0};
  std::uint64_t locks{0};
  std::uint64_t system_calls{0};  ///< other than sleeping and reading the clock
  std::int64_t page_faults{0};
};

/// From here on the calling thread is counted. Once a process.
void begin_watch();
/// Ends the count; by the same thread.
[[nodiscard]] ThreadCounts end_watch();

}  // namespace thermocomp::test
