/// A Unix stream socket at a path, with the care that a path needs. Only for this folder's .cpp
/// files.
#pragma once

#include <cstddef>
#include <filesystem>

#include <sys/types.h>

namespace thermocomp {

class ListeningSocket {
 public:
  /// @throws SocketError: somebody listens there, something else is there, folder missing, ...
  explicit ListeningSocket(std::filesystem::path path);
  ~ListeningSocket();  ///< closes, and removes the file if it is still ours
  ListeningSocket(const ListeningSocket&) = delete;
  ListeningSocket& operator=(const ListeningSocket&) = delete;

  [[nodiscard]] int fd() const noexcept { return fd_; }
  /// The next connection, non-blocking; -1 when there is none. Where the limit of open files allows
  /// it, its number is beyond those that select() can wait for: libmodbus waits with select(), and
  /// many clients must not use up the numbers that buses need.
  [[nodiscard]] int accept_one() noexcept;

 private:
  void remove_stale() const;

  std::filesystem::path path_;
  int fd_{-1};
  int reserve_fd_{-1};  ///< given up for a moment when descriptors run out
  dev_t device_{0};
  ino_t inode_{0};
};

/// Raises the process' soft limit of open files, as far as it may, to what `wanted` connections
/// need beside the rest of the daemon. @return for how many of them there is room
[[nodiscard]] std::size_t places_for_descriptors(std::size_t wanted) noexcept;

}  // namespace thermocomp
