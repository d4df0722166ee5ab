#include "daemon/socket/listening_socket.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <unistd.h>
#include <utility>

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include "daemon/socket/status_server.hpp"

namespace thermocomp {
namespace {

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = path.string();
  if (text.empty() || text.size() >= sizeof address.sun_path) {
    throw SocketError("status socket " + text + ": the path must have 1 to " +
                      std::to_string(sizeof address.sun_path - 1) + " characters");
  }
  std::memcpy(address.sun_path, text.data(), text.size());
  return address;
}

[[noreturn]] void fail(const std::filesystem::path& path) {
  throw SocketError("status socket " + path.string() + ": " + std::strerror(errno));
}

}  // namespace

ListeningSocket::ListeningSocket(std::filesystem::path path) : path_(std::move(path)) {
  const sockaddr_un address = address_of(path_);
  remove_stale();
  fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) fail(path_);
  struct stat status {};
  const bool listens =
      bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
      chmod(path_.c_str(), 0666) == 0 && listen(fd_, 64) == 0 && stat(path_.c_str(), &status) == 0;
  if (!listens) {
    const int error = errno;
    close(fd_);
    errno = error;
    fail(path_);
  }
  device_ = status.st_dev;
  inode_ = status.st_ino;
  reserve_fd_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
}

ListeningSocket::~ListeningSocket() {
  struct stat status {};
  if (stat(path_.c_str(), &status) == 0 && status.st_dev == device_ && status.st_ino == inode_) {
    unlink(path_.c_str());
  }
  close(fd_);
  if (reserve_fd_ >= 0) close(reserve_fd_);
}

void ListeningSocket::remove_stale() const {
  struct stat status {};
  if (lstat(path_.c_str(), &status) != 0) return;
  if (!S_ISSOCK(status.st_mode)) {
    throw SocketError("status socket " + path_.string() + ": there is a file that is no socket");
  }
  const sockaddr_un address = address_of(path_);
  const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (probe < 0) fail(path_);
  const int code = connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const bool is_refused = code != 0 && errno == ECONNREFUSED;
  close(probe);
  if (!is_refused) {
    throw SocketError("status socket " + path_.string() + ": another daemon listens there already");
  }
  if (unlink(path_.c_str()) != 0) fail(path_);
}

int ListeningSocket::accept_one() noexcept {
  const int fd = accept4(fd_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (fd < 0 && (errno == EMFILE || errno == ENFILE) && reserve_fd_ >= 0) {
    // Otherwise the connection would stay, and keep the owner's loop awake for ever.
    close(reserve_fd_);
    const int refused = accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC);
    if (refused >= 0) close(refused);
    reserve_fd_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
  }
  return fd;
}

}  // namespace thermocomp
