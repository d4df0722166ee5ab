#include "daemon/locks/name_lock.hpp"

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <unistd.h>
#include <utility>

#include <sys/socket.h>
#include <sys/un.h>

namespace thermocomp {
namespace {

struct Address {
  sockaddr_un socket{};
  socklen_t length{0};
};

/// FNV-1a (64 bits), for names that are too long for an address: the same on every build.
std::string short_text(const std::string& text) {
  std::uint64_t hash = 14695981039346656037u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return std::string("#").append(std::to_string(hash));
}

Address abstract_address(const std::string& name) {
  Address address;
  address.socket.sun_family = AF_UNIX;
  constexpr std::size_t room = sizeof address.socket.sun_path - 1;  // after the leading zero
  std::string text = "thermocomp/" + name;
  if (text.size() > room) {
    const std::string end = short_text(text);
    text.resize(room - end.size());
    text += end;
  }
  std::memcpy(address.socket.sun_path + 1, text.data(), text.size());
  address.length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + text.size());
  return address;
}

int open_socket() {
  return socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

std::string holder_of(const Address& address) {
  const int fd = open_socket();
  ucred who{};
  socklen_t size = sizeof who;
  const bool known =
      fd >= 0 &&
      connect(fd, reinterpret_cast<const sockaddr*>(&address.socket), address.length) == 0 &&
      getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &who, &size) == 0 && who.pid > 0;
  if (fd >= 0) close(fd);
  return known ? describe_process(who.pid) : "another process";
}

}  // namespace

NameLock::NameLock(const std::string& name) : fd_(open_socket()) {
  const Address address = abstract_address(name);
  // Listening is only for whoever is refused: so it can ask the kernel who we are.
  if (fd_ >= 0 &&
      bind(fd_, reinterpret_cast<const sockaddr*>(&address.socket), address.length) == 0 &&
      listen(fd_, SOMAXCONN) == 0)
    return;
  const int reason = errno;
  if (fd_ >= 0) close(fd_);
  if (reason == EADDRINUSE) throw LockHeld(name + " is in use by " + holder_of(address));
  throw LockImpossible(name + ": " + std::strerror(reason));
}

NameLock::~NameLock() {
  if (fd_ >= 0) close(fd_);
}

NameLock::NameLock(NameLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

}  // namespace thermocomp
