// SPDX-License-Identifier: GPL-2.0-or-later
#include "linuxcnc/daemon_link.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <unistd.h>

#include <sys/socket.h>
#include <sys/un.h>

namespace thermocomp_linuxcnc {

void DaemonLink::fail(const std::string& what, int code) {
  close();
  error_ = "the daemon at " + path_ + ": " + what;
  if (code != 0) error_.append(": ").append(std::strerror(code));
}

bool DaemonLink::connect() {
  close();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path_.empty() || path_.size() >= sizeof address.sun_path) {
    fail("no path of a socket", ENAMETOOLONG);
    return false;
  }
  std::memcpy(address.sun_path, path_.data(), path_.size());
  fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd_ < 0 || ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    fail("not reached", errno);
    return false;
  }
  error_.clear();
  return true;
}

void DaemonLink::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  input_.clear();
}

bool DaemonLink::send(const std::string& line) {
  const ssize_t count = ::send(fd_, line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  if (count == static_cast<ssize_t>(line.size())) return true;
  fail("takes no request", count < 0 ? errno : 0);
  return false;
}

std::optional<std::string> DaemonLink::receive() {
  std::array<char, 4096> bytes{};
  while (connected() && input_.find('\n') == std::string::npos) {
    const ssize_t count = recv(fd_, bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (count > 0) input_.append(bytes.data(), static_cast<std::size_t>(count));
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) return std::nullopt;
    if (count < 0) fail("connection lost", errno);
    if (count == 0) fail("connection closed", 0);
    if (input_.size() > line_bytes_max) fail("sends a line without an end", 0);
  }
  const std::size_t end = input_.find('\n');
  if (end == std::string::npos) return std::nullopt;
  std::string line = input_.substr(0, end);
  input_.erase(0, end + 1);
  return line;
}

}  // namespace thermocomp_linuxcnc
