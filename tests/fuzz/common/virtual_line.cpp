#include "virtual_line.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <cstring>
#include <ctime>
#include <poll.h>
#include <termios.h>
#include <unistd.h>
#include <utility>

#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/select.h>
#include <sys/syscall.h>

namespace thermocomp::fuzz {
namespace {

VirtualLine* line = nullptr;
VirtualCan* can = nullptr;
int serial_fd = -1;  ///< known from tcsetattr

}  // namespace

VirtualLine::VirtualLine(Peer peer) : peer_(std::move(peer)) {
  line = this;
  serial_fd = -1;
}
VirtualLine::~VirtualLine() {
  line = nullptr;
}

nanoseconds VirtualLine::tick() noexcept {
  now_ += std::chrono::microseconds(1);  // reading the clock takes time, so that loops end
  return now_;
}

void VirtualLine::pass(nanoseconds until) noexcept {
  now_ = std::max(now_, until);
}

void VirtualLine::arrive() {
  while (!under_way_.empty() && under_way_.front().at <= now_) {
    const Piece& piece = under_way_.front().piece;
    arrived_.insert(arrived_.end(), piece.bytes.begin(), piece.bytes.end());
    hung_up_ = hung_up_ || piece.hang_up;
    under_way_.pop_front();
  }
}

bool VirtualLine::wait_readable(nanoseconds until) {
  arrive();
  while (taken_ == arrived_.size() && !hung_up_) {
    const bool has_arrived = !under_way_.empty() && under_way_.front().at <= until;
    pass(has_arrived ? under_way_.front().at : until);
    if (!has_arrived) return false;
    arrive();
  }
  return true;
}

ssize_t VirtualLine::read(void* to, std::size_t size) {
  arrive();
  const std::size_t count = std::min(size, arrived_.size() - taken_);
  std::copy_n(arrived_.begin() + static_cast<std::ptrdiff_t>(taken_), count,
              static_cast<std::uint8_t*>(to));
  taken_ += count;
  if (count > 0 || hung_up_ || size == 0) return static_cast<ssize_t>(count);
  errno = EAGAIN;
  return -1;
}

ssize_t VirtualLine::write(const void* from, std::size_t size) {
  const auto* bytes = static_cast<const std::uint8_t*>(from);
  arrive();
  asked_at_ = arrived_.size();
  due_ = std::max(due_, now_);
  for (Piece& piece : peer_({bytes, size})) {
    due_ += piece.delay;
    under_way_.push_back({due_, std::move(piece)});
  }
  return static_cast<ssize_t>(size);
}

void VirtualLine::throw_away() {
  arrive();
  taken_ = arrived_.size();
}

VirtualCan::VirtualCan(Next next_in) : next(std::move(next_in)) {
  can = this;
}
VirtualCan::~VirtualCan() {
  can = nullptr;
}

namespace {

nanoseconds from(const timespec& time) {
  return std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec);
}

}  // namespace
}  // namespace thermocomp::fuzz

// The C library's functions. The shared library libmodbus finds these first.
using namespace thermocomp::fuzz;

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) {
  if (line == nullptr || clock != CLOCK_MONOTONIC) {
    return static_cast<int>(syscall(SYS_clock_gettime, clock, time));
  }
  const nanoseconds now = line->tick();
  *time = {now.count() / 1'000'000'000, now.count() % 1'000'000'000};
  return 0;
}

int ppoll(pollfd* entries, nfds_t count, const timespec* timeout, const sigset_t* mask) {
  if (line == nullptr) {
    return static_cast<int>(syscall(SYS_ppoll, entries, count, timeout, mask, sizeof(long)));
  }
  for (nfds_t i = 0; i < count; ++i) entries[i].revents = 0;
  const nanoseconds until = line->now() + from(*timeout);
  pollfd* asked = count > 1 ? &entries[1] : nullptr;  // the first is the wake-up, which never comes
  if (asked != nullptr && (asked->events & POLLOUT) != 0) {
    asked->revents = POLLOUT;
    return 1;
  }
  if (asked != nullptr && line->wait_readable(until)) {
    asked->revents = POLLIN;
    return 1;
  }
  line->pass(until);
  return 0;
}

int select(int count, fd_set* reads, fd_set* writes, fd_set* errors, timeval* timeout) {
  if (line == nullptr || reads == nullptr) {
    return static_cast<int>(syscall(SYS_select, count, reads, writes, errors, timeout));
  }
  const nanoseconds until = line->now() + std::chrono::seconds(timeout->tv_sec) +
                            std::chrono::microseconds(timeout->tv_usec);
  if (line->wait_readable(until)) return 1;  // the set is unchanged: it contains only the line
  FD_ZERO(reads);
  return 0;
}

ssize_t recv(int fd, void* to, std::size_t size, int flags) {
  if (line != nullptr) return line->read(to, size);
  return syscall(SYS_recvfrom, fd, to, size, flags, nullptr, nullptr);
}

ssize_t send(int fd, const void* bytes, std::size_t size, int flags) {
  if (line != nullptr) return line->write(bytes, size);
  return syscall(SYS_sendto, fd, bytes, size, flags, nullptr, 0);
}

ssize_t read(int fd, void* to, std::size_t size) {
  if (line != nullptr && fd == serial_fd) return line->read(to, size);
  return syscall(SYS_read, fd, to, size);
}

ssize_t write(int fd, const void* bytes, std::size_t size) {
  if (line != nullptr && fd == serial_fd) return line->write(bytes, size);
  return syscall(SYS_write, fd, bytes, size);
}

int connect(int fd, const sockaddr* address, socklen_t size) {
  if (line != nullptr) return 0;
  return static_cast<int>(syscall(SYS_connect, fd, address, size));
}

int tcgetattr(int, termios* settings) noexcept {
  *settings = {};
  return 0;
}

int tcsetattr(int fd, int, const termios*) noexcept {
  serial_fd = fd;
  return 0;
}

int tcflush(int, int) noexcept {
  if (line != nullptr) line->throw_away();
  return 0;
}

int socket(int family, int kind, int protocol) noexcept {
  // Any descriptor will do for scripted calls.
  if (family == PF_CAN && can != nullptr) family = AF_UNIX, kind = SOCK_DGRAM, protocol = 0;
  return static_cast<int>(syscall(SYS_socket, family, kind, protocol));
}

int setsockopt(int fd, int level, int option, const void* value, socklen_t size) noexcept {
  if (can != nullptr) return 0;
  return static_cast<int>(syscall(SYS_setsockopt, fd, level, option, value, size));
}

int bind(int fd, const sockaddr* address, socklen_t size) noexcept {
  if (can != nullptr) return 0;
  return static_cast<int>(syscall(SYS_bind, fd, address, size));
}

int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (can == nullptr) return static_cast<int>(syscall(SYS_ioctl, fd, request, argument));
  static_cast<ifreq*>(argument)->ifr_flags = IFF_UP | IFF_RUNNING;
  return 0;
}

int recvmmsg(int, mmsghdr* messages, unsigned int count, int, timespec*) {
  unsigned int filled = 0;
  while (can != nullptr && filled < count && can->next(messages[filled])) ++filled;
  if (filled > 0) return static_cast<int>(filled);
  errno = EAGAIN;
  return -1;
}

}  // extern "C"
