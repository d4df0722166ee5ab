/// What systemd is told: readiness, status, watchdog. Silent where the daemon is not a service.
#pragma once

#include <chrono>
#include <string>

namespace thermocomp {

class ServiceManager {
 public:
  ServiceManager();

  void ready(const std::string& status) noexcept;
  void reloading() noexcept;
  void stopping(const std::string& status) noexcept;
  /// Announces a slow stop: the daemon is not to be killed for the next `time`.
  void extend_stop(std::chrono::microseconds time) noexcept;
  void status(const std::string& status) noexcept;  ///< only sent when it has changed
  /// Feeds the watchdog; called only when the cycle has advanced.
  void alive() noexcept;

 private:
  std::string last_status_;
  std::chrono::steady_clock::duration watchdog_period_{};  ///< 0: no watchdog
  std::chrono::steady_clock::time_point last_alive_{};
};

}  // namespace thermocomp
