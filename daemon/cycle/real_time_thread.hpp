/// A thread with a real-time schedule, and memory that is not paged out.
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

/// Keeps all memory of the process resident once it has been touched, now and later, and keeps the
/// heap from being given back.
/// @return empty, or why it was not possible
[[nodiscard]] std::string lock_memory();

struct RealTimeThreadConfig {
  int priority{60};  ///< SCHED_FIFO
  int cpu{-1};       ///< -1: any
};

/// Runs `body` on a thread of its own with every signal blocked.
class RealTimeThread {
 public:
  RealTimeThread() = default;
  RealTimeThread(const RealTimeThread&) = delete;
  RealTimeThread& operator=(const RealTimeThread&) = delete;
  ~RealTimeThread() { join(); }

  /// @return empty, or why the thread runs with an ordinary schedule instead
  /// @throws RealTimeError when no thread could be made at all
  [[nodiscard]] std::string start(const RealTimeThreadConfig& config, std::function<void()> body);
  void join() noexcept;
  /// @return false: it has not ended within `patience`, and is still to be joined
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
