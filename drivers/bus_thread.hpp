/// An ordinary thread for one bus: named, with a stack sized on purpose, and deaf to signals.
#pragma once

#include <functional>
#include <pthread.h>
#include <signal.h>
#include <string>

#include "drivers/driver_error.hpp"

namespace thermocomp {

/// The daemon locks its memory, so every stack is resident in full: 256 KiB instead of glibc's
/// 8 MiB. The thread takes no signals (they belong to the main thread) and never inherits the
/// creator's real-time priority.
class BusThread {
 public:
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  static constexpr std::size_t stack_bytes =
      std::size_t{2048} * 1024;  // the sanitizers' frames are larger
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
  /// @throws DriverError when the system gives no thread
  void start(const std::string& name, std::function<void()> body) {
    body_ = std::move(body);
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, stack_bytes);
    pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
    // Blocked before the thread exists, so that it inherits the mask from its first instruction.
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

  /// Waits for the body's end; at once when not running.
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
