/// Event loop of the simulator's only thread: file descriptors and timers.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>

namespace thermocomp {

using std::chrono::nanoseconds;

class EventLoop {
 public:
  using Ready = std::function<void(short happened)>;  ///< POLLIN, POLLOUT, POLLHUP, ...
  using Wake = std::function<void()>;

  [[nodiscard]] static nanoseconds now();  ///< CLOCK_MONOTONIC

  /// Calls `ready` when one of `events` occurs on `file`; replaces an earlier watch.
  void watch(int file, short events, Ready ready);
  void change(int file, short events);
  void unwatch(int file);
  /// Calls `wake` once at `when` or as soon as possible after it. Equal times keep their order.
  void at(nanoseconds when, Wake wake);
  void run();  ///< until stop()
  void stop() noexcept { running_ = false; }

 private:
  struct Watch {
    std::uint64_t token;  ///< distinguishes successive uses of a descriptor number
    short events;
    Ready ready;
  };
  void wait_and_dispatch();
  void wake_due();

  bool running_{true};
  std::uint64_t tokens_{0};
  std::map<int, Watch> watches_;
  std::multimap<nanoseconds, Wake> wakes_;
};

}  // namespace thermocomp
