/// Who is at the other end of a Unix socket, and what that allows. Only for this folder's .cpp
/// files.
#pragma once

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
  std::optional<gid_t> bridge;
};

/// Asks the system, which may in turn ask a server of the site: too slow for every connection.
[[nodiscard]] AccessGroups look_up_groups(const SocketConfig& config);
/// As the kernel noted them at connect(). @return nothing when it does not tell
[[nodiscard]] std::optional<Peer> peer_of(int socket_fd);
/// @param daemon_user  the effective user of the daemon
[[nodiscard]] PeerAccess access_of(const Peer& peer, uid_t daemon_user, const AccessGroups& groups);

}  // namespace thermocomp
