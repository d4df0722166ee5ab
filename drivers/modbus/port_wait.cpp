#include "drivers/modbus/port_wait.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <poll.h>
#include <unistd.h>

#include <sys/eventfd.h>

#include "drivers/driver_error.hpp"
#include "drivers/monotonic_clock.hpp"

namespace thermocomp {
namespace {

timespec to_timespec(nanoseconds time) noexcept {
  const auto positive = std::max(time, nanoseconds{0});
  const auto whole = std::chrono::duration_cast<std::chrono::seconds>(positive);
  return {static_cast<time_t>(whole.count()), static_cast<long>((positive - whole).count())};
}

}  // namespace

InterruptibleWait::InterruptibleWait() : wake_fd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (wake_fd_ < 0) throw DriverError(std::string("eventfd: ") + std::strerror(errno));
}

InterruptibleWait::~InterruptibleWait() {
  ::close(wake_fd_);
}

void InterruptibleWait::cancel() noexcept {
  cancelled_.store(true, std::memory_order_release);
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(wake_fd_, &one, sizeof one);
}

PortWait InterruptibleWait::wait_for(int fd, short events, nanoseconds deadline) noexcept {
  while (true) {
    if (cancelled()) return PortWait::cancelled;
    std::array<pollfd, 2> waits{pollfd{wake_fd_, POLLIN, 0}, pollfd{fd, events, 0}};
    const timespec left = to_timespec(deadline - monotonic_now());
    const int count = ::ppoll(waits.data(), fd >= 0 ? 2 : 1, &left, nullptr);
    if (count > 0 && waits[0].revents != 0) return PortWait::cancelled;
    if (count > 0) return PortWait::ready;
    if (count == 0 && monotonic_now() >= deadline) return PortWait::late;
    if (count < 0 && errno != EINTR) return PortWait::late;
  }
}

bool InterruptibleWait::pause_until(nanoseconds time) noexcept {
  if (time <= monotonic_now()) return !cancelled();
  return wait_for(-1, 0, time) != PortWait::cancelled;
}

}  // namespace thermocomp
