/// A thread with real-time scheduling, and locked memory.
#pragma once

#include <chrono>
#include <functional>
#include <pthread.h>
#include <semaphore>
#include <stdexcept>
#include <string>

namespace thermocomp {

class RealTimeError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Locks all memory of the process, present and future, once touched, and disables returning heap
/// memory.
/// @return empty, or the reason of the failure
[[nodiscard]] std::string lock_memory();

struct RealTimeThreadConfig {
  int priority{60};  ///< SCHED_FIFO
  int cpu{-1};       ///< -1: any
};

/// Runs `body` on its own thread with all signals blocked.
class RealTimeThread {
 public:
  RealTimeThread() = default;
  RealTimeThread(const RealTimeThread&) = delete;
  RealTimeThread& operator=(const RealTimeThread&) = delete;
  ~RealTimeThread() { join(); }

  /// @return empty, or why the thread has ordinary scheduling
  /// @throws RealTimeError when no thread can be created
  [[nodiscard]] std::string start(const RealTimeThreadConfig& config, std::function<void()> body);
  void join() noexcept;
  /// @return false if it still runs after `patience` and must be joined
  [[nodiscard]] bool join_within(std::chrono::seconds patience) noexcept;

 private:
  static void* enter(void* self) noexcept;
  [[nodiscard]] int create(const RealTimeThreadConfig& config, bool fifo);

  std::function<void()> body_;
  pthread_t thread_{};
  bool running_{false};
  std::binary_semaphore ended_{0};  ///< the body has returned
};

}  // namespace thermocomp
