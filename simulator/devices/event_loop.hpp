/// One thread for everything the simulator does: files to watch and times to wake.
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

  /// Calls `ready` when one of `events` happens to `file`; replaces an earlier watch of it.
  void watch(int file, short events, Ready ready);
  /// Changes what is waited for; `file` is being watched.
  void change(int file, short events);
  void unwatch(int file);
  /// Calls `wake` once at `when`, or as soon after it as may be. Equal times keep their order.
  void at(nanoseconds when, Wake wake);
  void run();  ///< until stop()
  void stop() noexcept { running_ = false; }

 private:
  struct Watch {
    std::uint64_t token;  ///< tells a descriptor that was closed and opened again from itself
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
