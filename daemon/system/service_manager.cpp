#include "daemon/system/service_manager.hpp"

#include <cstdint>
#include <time.h>

#include <systemd/sd-daemon.h>

namespace thermocomp {

ServiceManager::ServiceManager() {
  std::uint64_t watchdog_us = 0;
  if (sd_watchdog_enabled(0, &watchdog_us) > 0)
    // Three times in its period: one late tick of main is no reason to be killed.
    watchdog_period_ = std::chrono::microseconds(watchdog_us / 3);
}

void ServiceManager::ready(const std::string& status) noexcept {
  last_status_ = status;
  sd_notifyf(0, "READY=1\nSTATUS=%s", status.c_str());
}

void ServiceManager::reloading() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  sd_notifyf(0, "RELOADING=1\nMONOTONIC_USEC=%lld",
             static_cast<long long>(now.tv_sec) * 1000000 + now.tv_nsec / 1000);
}

void ServiceManager::stopping(const std::string& status) noexcept {
  last_status_ = status;
  sd_notifyf(0, "STOPPING=1\nSTATUS=%s", status.c_str());
}

void ServiceManager::extend_stop(std::chrono::microseconds time) noexcept {
  sd_notifyf(0, "EXTEND_TIMEOUT_USEC=%lld", static_cast<long long>(time.count()));
}

void ServiceManager::status(const std::string& status) noexcept {
  if (status == last_status_) return;
  last_status_ = status;
  sd_notifyf(0, "STATUS=%s", status.c_str());
}

void ServiceManager::alive() noexcept {
  if (watchdog_period_ == std::chrono::steady_clock::duration{}) return;
  const auto now = std::chrono::steady_clock::now();
  if (now - last_alive_ < watchdog_period_) return;
  last_alive_ = now;
  sd_notify(0, "WATCHDOG=1");
}

}  // namespace thermocomp
