/// Waiting for a descriptor, a time or cancel(), whichever comes first. Only for the .cpp files of
/// this folder.
#pragma once

#include <atomic>

#include "drivers/modbus/port.hpp"

namespace thermocomp {

class InterruptibleWait {
 public:
  /// @throws DriverError when the system has no more descriptors
  InterruptibleWait();
  InterruptibleWait(const InterruptibleWait&) = delete;
  InterruptibleWait& operator=(const InterruptibleWait&) = delete;
  ~InterruptibleWait();

  /// Waits for `events` of `fd` (negative: for nothing but the time), cancel() or the deadline.
  /// Errors of the descriptor count as ready: the following read or write names them.
  PortWait wait_for(int fd, short events, nanoseconds deadline) noexcept;
  bool pause_until(nanoseconds time) noexcept;  ///< @return false when cancelled
  void cancel() noexcept;
  [[nodiscard]] bool cancelled() const noexcept {
    return cancelled_.load(std::memory_order_acquire);
  }

 private:
  int wake_fd_;
  std::atomic<bool> cancelled_{false};
};

}  // namespace thermocomp
