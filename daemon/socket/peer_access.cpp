#include "daemon/socket/peer_access.hpp"

#include <algorithm>
#include <cerrno>
#include <grp.h>

#include <sys/socket.h>

namespace thermocomp {
namespace {

std::optional<gid_t> group_called(const std::string& name) {
  group entry{};
  group* found = nullptr;
  std::vector<char> text(std::size_t{16} * 1024);
  while (getgrnam_r(name.c_str(), &entry, text.data(), text.size(), &found) == ERANGE &&
         text.size() < (4u << 20)) {
    text.resize(text.size() * 2);
  }
  if (found == nullptr) return std::nullopt;
  return entry.gr_gid;
}

bool is_member(const Peer& peer, gid_t group) {
  return peer.group == group ||
         std::find(peer.groups.begin(), peer.groups.end(), group) != peer.groups.end();
}

}  // namespace

std::optional<Peer> peer_of(int socket_fd) {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  if (getsockopt(socket_fd, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) {
    return std::nullopt;
  }
  Peer peer{credentials.uid, credentials.gid, {}};
  peer.groups.resize(1024);
  for (int attempt = 0; attempt < 2; ++attempt) {
    size = static_cast<socklen_t>(peer.groups.size() * sizeof(gid_t));
    const int code = getsockopt(socket_fd, SOL_SOCKET, SO_PEERGROUPS, peer.groups.data(), &size);
    const std::size_t count = size / sizeof(gid_t);
    if (code == 0) {
      peer.groups.resize(count);
      return peer;
    }
    if (errno != ERANGE) break;
    peer.groups.resize(count);  // the kernel says how many there are
  }
  peer.groups.clear();
  return peer;
}

AccessGroups look_up_groups(const SocketConfig& config) {
  return {group_called(config.read_group), group_called(config.operator_group),
          group_called(config.bridge_group)};
}

PeerAccess access_of(const Peer& peer, uid_t daemon_user, const AccessGroups& groups) {
  if (peer.user == 0) return {true, true, true};
  const bool is_own_user = peer.user == daemon_user;
  const auto allowed = [&](const std::optional<gid_t>& group) {
    // Without the groups this is a development daemon, and its own user stands for all of them.
    return group ? is_member(peer, *group) : is_own_user;
  };
  PeerAccess access;
  access.operate = allowed(groups.operate);
  access.bridge = allowed(groups.bridge);
  access.read = is_own_user || access.operate || access.bridge || allowed(groups.read);
  return access;
}

}  // namespace thermocomp
