/// Who is at the other end of a Unix socket, and what that allows. Only for this folder's .cpp
/// files.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "config/daemon_config.hpp"

namespace thermocomp {

struct Peer {
  uid_t user{0};
  gid_t group{0};
  std::vector<gid_t> groups;  ///< supplementary
};

struct PeerAccess {
  bool read{false};
  bool operate{false};
  bool bridge{false};
};

/// As the kernel noted them at connect(). @return nothing when it does not tell
[[nodiscard]] std::optional<Peer> peer_of(int socket_fd);
/// @param daemon_user  the effective user of the daemon
[[nodiscard]] PeerAccess access_of(const Peer& peer, uid_t daemon_user, const SocketConfig& config);

}  // namespace thermocomp
