#include "daemon/locks/file_lock.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <unistd.h>

#include <sys/file.h>
#include <sys/stat.h>

namespace thermocomp {
namespace {

std::filesystem::path lock_path(const std::filesystem::path& file) {
  std::error_code error;
  std::filesystem::path canonical = std::filesystem::weakly_canonical(file, error);
  if (error) canonical = std::filesystem::absolute(file, error);
  if (error) throw LockImpossible(file.string() + ": " + error.message());
  return canonical.concat(".lock");
}

/// Who released the lock may have removed the file between our opening and our locking it.
bool is_at(int fd, const std::filesystem::path& path) noexcept {
  struct stat ours {};
  struct stat there {};
  return fstat(fd, &ours) == 0 && stat(path.c_str(), &there) == 0 && ours.st_dev == there.st_dev &&
         ours.st_ino == there.st_ino;
}

std::string content(int fd) {
  std::array<char, 1024> text{};
  const ssize_t count = pread(fd, text.data(), text.size(), 0);
  std::string said(text.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
  while (!said.empty() && said.back() == '\n') said.pop_back();
  return said.empty() ? "another process" : said;
}

}  // namespace

FileLock::FileLock(const std::filesystem::path& file) : path_(lock_path(file)) {
  for (;;) {
    // NOFOLLOW: where others may write to the folder, a link must not lead us to a file of ours.
    // 0600: whoever may read a file may lock it too, and so keep its owner out.
    fd_ = open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
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
  static_cast<void>(fchmod(fd_, 0600) == 0);  // one that was left by an earlier version
  // For people only: where it cannot be written (disk full), the lock holds all the same.
  const std::string holder = describe_process(getpid()) + "\n";
  if (ftruncate(fd_, 0) != 0 ||
      pwrite(fd_, holder.data(), holder.size(), 0) != static_cast<ssize_t>(holder.size())) {
    static_cast<void>(ftruncate(fd_, 0) == 0);
  }
}

FileLock::~FileLock() {
  unlink(path_.c_str());  // while it is still held
  close(fd_);
}

}  // namespace thermocomp
