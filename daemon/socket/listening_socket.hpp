/// A Unix stream socket at a path, with the care that a path needs; who is at the other end of a
/// connection, and what that allows. Only for this folder's .cpp files.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "config/daemon/daemon_config.hpp"
#include "daemon/socket/rpc.hpp"

namespace thermocomp {

struct Peer {
  uid_t user{0};
  gid_t group{0};
  std::vector<gid_t> groups;  ///< supplementary
};

/// The groups of the configuration as the system knows them; none for those it does not know.
struct AccessGroups {
  std::optional<gid_t> read;
  std::optional<gid_t> operate;
  std::optional<gid_t> model;
  std::optional<gid_t> bridge;
};

/// Asks the system, which may in turn ask a server of the site: too slow for every connection.
[[nodiscard]] AccessGroups look_up_groups(const SocketConfig& config);
/// As the kernel noted them at connect(). @return nothing when it does not tell
[[nodiscard]] std::optional<Peer> peer_of(int socket_fd);
/// @param daemon_user  the effective user of the daemon
[[nodiscard]] PeerAccess access_of(const Peer& peer, uid_t daemon_user, const AccessGroups& groups);

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
