/// What ends a driver thread's sleep from another thread.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <poll.h>
#include <unistd.h>

#include <sys/eventfd.h>

#include "drivers/driver_error.hpp"
#include "drivers/monotonic_clock.hpp"

namespace thermocomp {

/// Once signalled it stays so: every later sleep ends at once. signal() may come from any thread.
class WakeEvent {
 public:
  /// @throws DriverError when the system has no more descriptors
  WakeEvent() : descriptor_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (descriptor_ < 0) throw DriverError("no descriptor for a wake event");
  }
  WakeEvent(const WakeEvent&) = delete;
  WakeEvent& operator=(const WakeEvent&) = delete;
  ~WakeEvent() { ::close(descriptor_); }

  void signal() noexcept {
    const std::uint64_t one = 1;
    // It can only fail when the counter is full, and then it is signalled already.
    [[maybe_unused]] const ssize_t written = ::write(descriptor_, &one, sizeof one);
  }

  /// Sleeps until `time` (CLOCK_MONOTONIC), the event, or input (or an error) at `other`
  /// (negative: none); an interrupted sleep ends early.
  void wait_until(std::chrono::nanoseconds time, int other = -1) noexcept {
    const std::chrono::nanoseconds left = time - monotonic_now();
    if (left <= std::chrono::nanoseconds{0}) return;
    const auto whole = std::chrono::duration_cast<std::chrono::seconds>(left);
    const timespec limit{static_cast<time_t>(whole.count()),
                         static_cast<long>((left - whole).count())};
    std::array<pollfd, 2> watched{pollfd{descriptor_, POLLIN, 0}, pollfd{other, POLLIN, 0}};
    ::ppoll(watched.data(), watched.size(), &limit, nullptr);
  }

 private:
  int descriptor_;
};

}  // namespace thermocomp
