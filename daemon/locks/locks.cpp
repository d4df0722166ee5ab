#include "daemon/locks/locks.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include <sys/file.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

namespace thermocomp {

std::string describe_process(pid_t process) {
  constexpr std::size_t shown_max = 512;
  const std::string number = std::to_string(process);
  std::ifstream in("/proc/" + number + "/cmdline", std::ios::binary);
  std::string line{std::istreambuf_iterator<char>(in), {}};
  while (!line.empty() && line.back() == '\0') line.pop_back();
  std::replace_if(
      line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  line.resize(std::min(line.size(), shown_max));
  return "process " + number + (line.empty() ? "" : " (" + line + ")");
}

namespace {

std::filesystem::path lock_path(const std::filesystem::path& file) {
  std::error_code error;
  std::filesystem::path canonical = std::filesystem::weakly_canonical(file, error);
  if (error) canonical = std::filesystem::absolute(file, error);
  if (error) throw LockImpossible(file.string() + ": " + error.message());
  return canonical.concat(".lock");
}

/// False if the previous holder removed the file between open() and flock().
bool is_at(int fd, const std::filesystem::path& path) noexcept {
  struct stat ours {};
  struct stat there {};
  return fstat(fd, &ours) == 0 && stat(path.c_str(), &there) == 0 && ours.st_dev == there.st_dev &&
         ours.st_ino == there.st_ino;
}

std::string content(int fd) {
  std::array<char, 1024> text{};
  const ssize_t count = pread(fd, text.data(), text.size(), 0);
  std::string holder(text.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
  while (!holder.empty() && holder.back() == '\n') holder.pop_back();
  return holder.empty() ? "another process" : holder;
}

}  // namespace

FileLock::FileLock(const std::filesystem::path& file) : path_(lock_path(file)) {
  for (;;) {
    // NOFOLLOW: in a folder writable by others, a link must not lead to another file of ours. 0600:
    // a user who can read the file could lock it and keep its owner out.
    fd_ = open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
    if (fd_ < 0 && errno == ENOENT)
      throw LockImpossible(
          path_.parent_path().string() +
          ": there is no such folder: make it, or name another in the configuration");
    if (fd_ < 0) throw LockImpossible(path_.string() + ": " + std::strerror(errno));
    if (flock(fd_, LOCK_EX | LOCK_NB) != 0) {
      const int reason = errno;
      const std::string holder = content(fd_);
      close(fd_);
      if (reason == EINTR) continue;
      if (reason != EWOULDBLOCK)
        throw LockImpossible(path_.string() + ": " + std::strerror(reason));
      throw LockHeld(file.string() + " is in use by " + holder);
    }
    if (is_at(fd_, path_)) break;
    close(fd_);
  }
  static_cast<void>(fchmod(fd_, 0600) == 0);  // an earlier version may have left another mode
  // Informative only: the lock is valid even if this cannot be written (disk full).
  const std::string holder = describe_process(getpid()) + "\n";
  if (ftruncate(fd_, 0) != 0 ||
      pwrite(fd_, holder.data(), holder.size(), 0) != static_cast<ssize_t>(holder.size())) {
    static_cast<void>(ftruncate(fd_, 0) == 0);
  }
}

FileLock::~FileLock() {
  unlink(path_.c_str());  // while still locked
  close(fd_);
}

namespace {

using namespace std::chrono_literals;

constexpr std::size_t room = sizeof(sockaddr_un::sun_path) - 1;  // after the leading zero
constexpr std::size_t random_digits = 16;

struct Address {
  sockaddr_un socket{};
  socklen_t length{0};
};

/// FNV-1a (64 bits) of a name too long for an address; the same on every build.
std::string short_text(const std::string& text) {
  std::uint64_t hash = 14695981039346656037u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return std::string("#").append(std::to_string(hash));
}

/// Common prefix of the addresses of all holders of a name.
std::string prefix_of(const std::string& name) {
  std::string text = "thermocomp/" + name;
  if (text.size() + 1 + random_digits > room) {
    const std::string end = short_text(text);
    text.resize(room - 1 - random_digits - end.size());
    text += end;
  }
  return text + "/";
}

/// @throws LockImpossible
std::string random_text() {
  std::uint64_t number = 0;
  if (getrandom(&number, sizeof number, 0) != sizeof number)
    throw LockImpossible(std::string("getrandom: ") + std::strerror(errno));
  std::string text(random_digits, '0');
  for (char& digit : text) {
    digit = "0123456789abcdef"[number & 0xF];
    number >>= 4;
  }
  return text;
}

Address abstract_address(const std::string& text) {
  Address address;
  address.socket.sun_family = AF_UNIX;
  std::memcpy(address.socket.sun_path + 1, text.data(), text.size());
  address.length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + text.size());
  return address;
}

int open_socket() {
  return socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

/// Credentials of the listener at the address; none: no listener.
std::optional<ucred> listener_at(const std::string& text) {
  const Address address = abstract_address(text);
  const int fd = open_socket();
  ucred who{};
  socklen_t size = sizeof who;
  const bool known =
      fd >= 0 &&
      connect(fd, reinterpret_cast<const sockaddr*>(&address.socket), address.length) == 0 &&
      getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &who, &size) == 0;
  if (fd >= 0) close(fd);
  return known ? std::optional(who) : std::nullopt;
}

/// Random parts of the addresses with this prefix that have a listener. A line of the table ends
/// with the address, where "@" stands for the leading zero. The flag marks a listener: connections
/// in its backlog have the same address.
/// @throws LockImpossible
std::vector<std::string> listened_with(const std::string& prefix) {
  std::ifstream table("/proc/self/net/unix");
  std::vector<std::string> found;
  for (std::string line; std::getline(table, line);) {
    const std::size_t at = line.find("@" + prefix);
    const std::size_t rest = at + 1 + prefix.size();
    if (at != std::string::npos && line.size() == rest + random_digits &&
        line.find(" 00010000 ") < at)
      found.emplace_back(line, rest);
  }
  if (!table.eof()) throw LockImpossible("/proc/self/net/unix cannot be read");
  return found;
}

/// When two processes start at the same moment, the one with the higher number refuses at once and
/// the other waits for that. A holder still present after the wait had the name before.
/// @throws LockHeld, LockImpossible
void refuse_if_held(const std::string& name, const std::string& prefix, const std::string& own) {
  constexpr int looks_max = 20;
  std::map<std::string, std::optional<ucred>> asked;  // once: a query fills the holder's backlog
  for (int look = 1;; ++look) {
    std::optional<ucred> holder;
    bool must_refuse = look == looks_max;
    for (const std::string& other : listened_with(prefix)) {
      if (other == own) continue;
      if (!asked.contains(other)) asked[other] = listener_at(prefix + other);
      const std::optional<ucred>& who = asked[other];
      if (!who || (who->uid != 0 && who->uid != geteuid())) continue;
      holder = who;
      must_refuse = must_refuse || other < own;
    }
    if (!holder) return;
    if (must_refuse) {
      const bool is_visible = holder->pid > 0;  // 0: in another process namespace
      throw LockHeld(name + " is in use by " +
                     (is_visible ? describe_process(holder->pid) : "another process"));
    }
    std::this_thread::sleep_for(25ms);
  }
}

}  // namespace

NameLock::NameLock(const std::string& name) : fd_(open_socket()) {
  const std::string prefix = prefix_of(name);
  const std::string own = random_text();
  const Address address = abstract_address(prefix + own);
  try {
    if (!(fd_ >= 0 &&
          bind(fd_, reinterpret_cast<const sockaddr*>(&address.socket), address.length) == 0 &&
          listen(fd_, SOMAXCONN) == 0))
      throw LockImpossible(name + ": " + std::strerror(errno));
    refuse_if_held(name, prefix, own);
  } catch (...) {
    if (fd_ >= 0) close(fd_);
    throw;
  }
}

NameLock::~NameLock() {
  if (fd_ >= 0) close(fd_);
}

void NameLock::drain() noexcept {
  constexpr int questions_max = 1000;
  for (int i = 0; i < questions_max; ++i) {
    const int fd = accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC);
    if (fd < 0) return;
    close(fd);
  }
}

NameLock::NameLock(NameLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

}  // namespace thermocomp
