/// Notifications to systemd: readiness, status, watchdog. Does nothing if not run as a service.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include <sys/socket.h>
#include <sys/un.h>

namespace thermocomp {

/// Never blocks, unlike sd_notify(): text that systemd did not accept is sent with the next
/// notification; a watchdog signal is not repeated.
class ServiceManager {
 public:
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  void ready(const std::string& status) noexcept;
  void reloading() noexcept;
  void stopping(const std::string& status) noexcept;
  /// Announces a slow stop: extends the stop time-out by `time`.
  void extend_stop(std::chrono::microseconds time) noexcept;
  void status(const std::string& status) noexcept;  ///< sent on change only
  /// Feeds the watchdog; call only when the cycle has advanced.
  void alive() noexcept;

 private:
  static constexpr std::size_t unsent_bytes_max = 2048;
  void send(const std::string& text, bool is_kept = true) noexcept;

  int fd_{-1};  ///< -1: not a service
  sockaddr_un address_{};
  socklen_t address_bytes_{0};
  std::string unsent_;
  std::string last_status_;
  std::chrono::steady_clock::duration watchdog_period_{};  ///< 0: no watchdog
  std::chrono::steady_clock::time_point last_alive_{};
};

}  // namespace thermocomp
