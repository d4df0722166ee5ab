#include "daemon/system/service_manager.hpp"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <time.h>
#include <unistd.h>

#include <sys/socket.h>
#include <sys/un.h>
#include <systemd/sd-daemon.h>

namespace thermocomp {

namespace {

constexpr auto alive_period_max = std::chrono::milliseconds(500);

}  // namespace

ServiceManager::ServiceManager() {
  std::uint64_t watchdog_us = 0;
  if (sd_watchdog_enabled(0, &watchdog_us) > 0)
    // At least three times per period: one late tick of main must not trigger the watchdog.
    watchdog_period_ = std::min<std::chrono::steady_clock::duration>(
        std::chrono::microseconds(watchdog_us / 3), alive_period_max);
  const char* path = std::getenv("NOTIFY_SOCKET");
  if (path == nullptr || (path[0] != '/' && path[0] != '@')) return;
  if (std::strlen(path) >= sizeof address_.sun_path) return;
  address_.sun_family = AF_UNIX;
  std::strcpy(address_.sun_path, path);
  address_bytes_ = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + std::strlen(path));
  if (path[0] == '@') address_.sun_path[0] = '\0';
  fd_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

ServiceManager::~ServiceManager() {
  if (fd_ >= 0) close(fd_);
}

void ServiceManager::send(const std::string& text, bool is_kept) noexcept {
  if (fd_ < 0) return;
  const std::string all = unsent_ + text;
  const auto sent = sendto(fd_, all.data(), all.size(), MSG_NOSIGNAL,
                           reinterpret_cast<const sockaddr*>(&address_), address_bytes_);
  const bool is_full = sent < 0 && (errno == EAGAIN || errno == ENOBUFS);
  if (!is_full)
    unsent_.clear();
  else if (is_kept)
    unsent_ = all.size() <= unsent_bytes_max ? all : text;
}

void ServiceManager::ready(const std::string& status) noexcept {
  last_status_ = status;
  send("READY=1\nSTATUS=" + status + "\n");
}

void ServiceManager::reloading() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  const std::int64_t us = std::int64_t{now.tv_sec} * 1000000 + now.tv_nsec / 1000;
  send("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(us) + "\n");
}

void ServiceManager::stopping(const std::string& status) noexcept {
  last_status_ = status;
  send("STOPPING=1\nSTATUS=" + status + "\n");
}

void ServiceManager::extend_stop(std::chrono::microseconds time) noexcept {
  send("EXTEND_TIMEOUT_USEC=" + std::to_string(time.count()) + "\n");
}

void ServiceManager::status(const std::string& status) noexcept {
  if (status == last_status_) return;
  last_status_ = status;
  send("STATUS=" + status + "\n");
}

void ServiceManager::alive() noexcept {
  if (watchdog_period_ == std::chrono::steady_clock::duration{}) return;
  const auto now = std::chrono::steady_clock::now();
  if (now - last_alive_ < watchdog_period_) return;
  last_alive_ = now;
  send("WATCHDOG=1\n", false);
}

}  // namespace thermocomp
