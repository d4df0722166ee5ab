#include "drivers/modbus/tcp_port.hpp"

#include <cerrno>
#include <cstring>
#include <poll.h>
#include <unistd.h>

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include "drivers/monotonic_clock.hpp"

namespace thermocomp {

nanoseconds TcpPort::now() const noexcept {
  return monotonic_now();
}

bool TcpPort::open(std::string& why) {
  constexpr std::chrono::milliseconds name_service_max{2000};
  if (!lookup_) lookup_ = std::make_unique<NameLookup>(tcp_.host, tcp_.port);
  if (!lookup_->done()) {
    const PortWait wait =
        wait_.wait_for(lookup_->done_fd(), POLLIN, monotonic_now() + name_service_max);
    if (wait != PortWait::ready) {
      why = tcp_.host + ": the name service does not answer";
      return false;
    }
  }
  const auto address = lookup_->result(why);
  lookup_.reset();  // names may move: asked anew for every connection
  return address && open_socket(*address, why);
}

bool TcpPort::open_socket(const SocketAddress& address, std::string& why) {
  const int type = tcp_.datagrams ? SOCK_DGRAM : SOCK_STREAM;
  const int fd = ::socket(address.storage.ss_family, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) {
    why = std::strerror(errno);
    return false;
  }
  const int on = 1;
  if (!tcp_.datagrams) ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  int error = 0;
  const auto* target = reinterpret_cast<const sockaddr*>(&address.storage);
  if (::connect(fd, target, address.length) != 0) {
    error = errno;
    if (error == EINPROGRESS) {
      const PortWait wait = wait_.wait_for(fd, POLLOUT, monotonic_now() + connect_max_);
      socklen_t size = sizeof error;
      if (wait == PortWait::ready) ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
      if (wait == PortWait::late) error = ETIMEDOUT;
      if (wait == PortWait::cancelled) error = ECANCELED;
    }
  }
  if (error != 0) {
    ::close(fd);
    why = std::strerror(error);
    return false;
  }
  fd_ = fd;
  return true;
}

void TcpPort::close_socket() noexcept {
  if (fd_ < 0) return;
  ::shutdown(fd_, SHUT_RDWR);
  ::close(fd_);
  fd_ = -1;
}

bool TcpPort::send(std::span<const std::uint8_t> bytes) noexcept {
  return ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
         static_cast<ssize_t>(bytes.size());
}

PortWait TcpPort::wait_for_input(nanoseconds deadline) noexcept {
  return wait_.wait_for(fd_, POLLIN, deadline);
}

PortBytes TcpPort::receive(std::span<std::uint8_t> into) noexcept {
  while (true) {
    const ssize_t count = ::recv(fd_, into.data(), into.size(), MSG_DONTWAIT);
    if (count > 0) return {PortBytes::Kind::bytes, static_cast<std::size_t>(count)};
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno == EAGAIN) return {PortBytes::Kind::nothing};
    return {PortBytes::Kind::lost};
  }
}

}  // namespace thermocomp
