#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <functional>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <string>
#include <unistd.h>

#include <sys/eventfd.h>

#include "drivers/bus.hpp"

namespace thermocomp {

/// The clock of all drivers, CLOCK_MONOTONIC: the time of every Reading.
[[nodiscard]] inline std::chrono::nanoseconds monotonic_now() noexcept {
  return std::chrono::steady_clock::now().time_since_epoch();
}

/// Converts a configured time, limited to a year so that sums never overflow.
[[nodiscard]] inline std::chrono::nanoseconds from_seconds(double time_s) noexcept {
  constexpr double year_s = 365.0 * 86400.0;
  if (!(time_s > 0.0)) return std::chrono::nanoseconds{0};
  return std::chrono::nanoseconds{
      static_cast<std::chrono::nanoseconds::rep>((time_s < year_s ? time_s : year_s) * 1e9)};
}

/// Event that stays signalled: every later sleep ends at once. signal() may be called from any
/// thread.
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
    // Fails only if the counter is full, hence already signalled.
    [[maybe_unused]] const ssize_t written = ::write(descriptor_, &one, sizeof one);
  }

  /// Sleeps until `time` (CLOCK_MONOTONIC), the event, or input or an error at `other` (negative:
  /// none); an interrupted sleep ends early.
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

/// A thread with a small stack, since the daemon locks its memory and the whole stack is resident
/// (256 KiB instead of glibc's 8 MiB). It blocks all signals, which belong to the main thread, and
/// never inherits the creator's real-time priority.
class BusThread {
 public:
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  static constexpr std::size_t stack_bytes =
      std::size_t{2048} * 1024;  // frames are larger under the sanitizers
#else
  static constexpr std::size_t stack_bytes = std::size_t{256} * 1024;
#endif

  BusThread() = default;
  BusThread(const BusThread&) = delete;
  BusThread& operator=(const BusThread&) = delete;
  ~BusThread() {
    join();
  }

  /// Runs `body` in a new thread. `name` is cut to the kernel's 15 characters.
  /// @pre not running
  /// @throws DriverError when the system cannot create a thread
  void start(const std::string& name, std::function<void()> body) {
    body_ = std::move(body);
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, stack_bytes);
    pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
    // Blocked before the thread exists, so that it inherits the mask.
    sigset_t all;
    sigset_t before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const int error = pthread_create(&thread_, &attributes, &BusThread::run, this);
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    pthread_attr_destroy(&attributes);
    if (error != 0) throw DriverError("no thread for " + name);
    running_ = true;
    pthread_setname_np(thread_, name.substr(0, 15).c_str());
  }

  /// Waits until the body ends; returns at once when not running.
  void join() noexcept {
    if (!running_) return;
    pthread_join(thread_, nullptr);
    running_ = false;
  }

  [[nodiscard]] bool running() const noexcept {
    return running_;
  }

 private:
  static void* run(void* self) {
    static_cast<BusThread*>(self)->body_();
    return nullptr;
  }

  std::function<void()> body_;
  pthread_t thread_{};
  bool running_{false};
};

}  // namespace thermocomp
