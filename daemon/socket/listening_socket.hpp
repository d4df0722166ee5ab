/// A listening Unix stream socket with its file, and the permissions of a connection's peer. Only
/// for this folder's .cpp files.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "config/daemon/daemon_config.hpp"
#include "daemon/socket/rpc.hpp"
#include "daemon/threads/side_thread.hpp"

namespace thermocomp {

struct Peer {
  uid_t user{0};
  gid_t group{0};
  std::vector<gid_t> groups;  ///< supplementary
};

/// Credentials at connect(), from the kernel. @return none if not available
[[nodiscard]] std::optional<Peer> peer_of(int socket_fd);

/// IDs of the configured groups; none for a group unknown to the system.
struct AccessGroups {
  std::optional<gid_t> read;
  std::optional<gid_t> operate;
  std::optional<gid_t> model;
  std::optional<gid_t> bridge;
};

/// Resolves the groups. May query a network name service, too slow for every connection.
[[nodiscard]] AccessGroups look_up_groups(const SocketConfig& config);
/// @param daemon_user  the effective user of the daemon
[[nodiscard]] PeerAccess access_of(const Peer& peer, uid_t daemon_user, const AccessGroups& groups);

/// The permissions of peers. Changes of the groups apply within seconds, without a restart.
class AccessRules {
 public:
  explicit AccessRules(const SocketConfig& config);
  [[nodiscard]] PeerAccess of(const Peer& peer, std::chrono::steady_clock::time_point now);

 private:
  void ask_groups(std::chrono::steady_clock::duration at_most);

  SocketConfig config_;
  AccessGroups groups_;
  std::shared_ptr<AccessGroups> found_;  ///< owned by the thread while it is busy
  std::chrono::steady_clock::time_point asked_at_{};
  SideThread thread_{"groups"};  ///< the name service may be slow
};

class ListeningSocket {
 public:
  /// @throws SocketError: another process listens there, another file exists, folder missing, ...
  explicit ListeningSocket(std::filesystem::path path);
  ~ListeningSocket();  ///< closes, and removes the file if it is still ours
  ListeningSocket(const ListeningSocket&) = delete;
  ListeningSocket& operator=(const ListeningSocket&) = delete;

  [[nodiscard]] int fd() const noexcept { return fd_; }
  /// The next connection, non-blocking; -1 when there is none. Its descriptor is above FD_SETSIZE
  /// if the limit of open files allows: libmodbus uses select(), and the low descriptors must
  /// remain for the buses.
  [[nodiscard]] int accept_one() noexcept;

 private:
  void remove_stale() const;

  std::filesystem::path path_;
  int fd_{-1};
  int reserve_fd_{-1};  ///< closed for a moment when descriptors run out
  dev_t device_{0};
  ino_t inode_{0};
};

/// Raises the process' soft limit of open files for `wanted` connections and the rest of the
/// daemon. @return the number of connections possible
[[nodiscard]] std::size_t places_for_descriptors(std::size_t wanted) noexcept;

}  // namespace thermocomp
