// Stub of the daemon's cycle for the tests of the links.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <thread>

#include "drivers/bus_thread.hpp"
#include "drivers/controllers/controller_link.hpp"

namespace thermocomp::test {

/// A cycle at 100 Hz with its link: takes the state and offers the wanted offsets with its epoch.
template <class Link>
class Cycle {
 public:
  explicit Cycle(Link& link, std::uint32_t epoch = 0) : fixed_epoch(epoch), link_(link) {
    link.start();
    thread_ = std::thread([this] { run(); });
  }
  Cycle(const Cycle&) = delete;
  Cycle& operator=(const Cycle&) = delete;
  ~Cycle() {
    stopping_ = true;
    thread_.join();
  }

  void want(std::size_t axis, double offset_um, bool valid = true) {
    const std::scoped_lock lock(mutex_);
    wanted_.offset_um[axis] = offset_um;
    wanted_.valid[axis] = valid;
  }
  [[nodiscard]] ControllerState state() const {
    const std::scoped_lock lock(mutex_);
    return state_;
  }
  /// Stops offering (a hung cycle) but still takes the state.
  std::atomic<bool> hung{false};
  /// Commands keep this epoch instead of the newest; 0: the newest.
  std::atomic<std::uint32_t> fixed_epoch;

 private:
  void run() {
    while (!stopping_) {
      {
        const std::scoped_lock lock(mutex_);
        link_.newest(state_);
        wanted_.link_epoch = fixed_epoch != 0 ? fixed_epoch.load() : state_.link_epoch;
        wanted_.read_back_number = state_.read_back_number;
        if (!hung) link_.offer(wanted_);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
    }
  }

  Link& link_;
  mutable std::mutex mutex_;
  OffsetCommand wanted_{};
  ControllerState state_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

/// Waits until `holds` for at most a minute.
template <class Condition>
bool eventually(Condition&& holds) {
  const auto until = monotonic_now() + std::chrono::minutes{1};
  while (!holds()) {
    if (monotonic_now() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  return true;
}

}  // namespace thermocomp::test
