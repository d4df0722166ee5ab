/// What is sent to systemd: readiness, status, watchdog. Silent where the daemon is not a service.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include <sys/socket.h>
#include <sys/un.h>

namespace thermocomp {

/// Main never waits for it, as sd_notify() would when systemd does not read: what it did not take
/// is sent again with the next news, a sign of life is not.
class ServiceManager {
 public:
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  void ready(const std::string& status) noexcept;
  void reloading() noexcept;
  void stopping(const std::string& status) noexcept;
  /// Announces a slow stop: the daemon is not to be killed for the next `time`.
  void extend_stop(std::chrono::microseconds time) noexcept;
  void status(const std::string& status) noexcept;  ///< only sent when it has changed
  /// Feeds the watchdog; called only when the cycle has advanced.
  void alive() noexcept;

 private:
  static constexpr std::size_t unsent_bytes_max = 2048;
  void send(const std::string& news, bool is_kept = true) noexcept;

  int fd_{-1};  ///< -1: no service
  sockaddr_un address_{};
  socklen_t address_bytes_{0};
  std::string unsent_;
  std::string last_status_;
  std::chrono::steady_clock::duration watchdog_period_{};  ///< 0: no watchdog
  std::chrono::steady_clock::time_point last_alive_{};
};

}  // namespace thermocomp
