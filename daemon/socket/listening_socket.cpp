#include "daemon/socket/listening_socket.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <grp.h>
#include <string>
#include <time.h>
#include <unistd.h>
#include <utility>

#include <sys/file.h>
#include <sys/resource.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include "daemon/socket/rpc.hpp"

namespace thermocomp {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto groups_known_for = std::chrono::seconds(5);
/// Time-outs of the name service, which is queried on a side thread: local groups are found at
/// once, and a server that does not answer delays no client.
constexpr auto groups_first_within = std::chrono::seconds(2);
constexpr auto groups_within = std::chrono::milliseconds(50);

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
    peer.groups.resize(count);  // the kernel returned the required size
  }
  peer.groups.clear();
  return peer;
}

AccessGroups look_up_groups(const SocketConfig& config) {
  return {group_called(config.read_group), group_called(config.operator_group),
          group_called(config.model_group), group_called(config.bridge_group)};
}

PeerAccess access_of(const Peer& peer, uid_t daemon_user, const AccessGroups& groups) {
  if (peer.user == 0) return PeerAccess::of_root();
  const bool is_own_user = peer.user == daemon_user;
  const auto allowed = [&](const std::optional<gid_t>& group) {
    // On a development system without these groups, the daemon's user has their permissions.
    return group ? is_member(peer, *group) : is_own_user;
  };
  PeerAccess access;
  access.operate = allowed(groups.operate);
  access.model = access.operate || allowed(groups.model);
  access.bridge = allowed(groups.bridge);
  access.read = is_own_user || access.model || access.bridge || allowed(groups.read);
  return access;
}

AccessRules::AccessRules(const SocketConfig& config) : config_(config) {
  ask_groups(groups_first_within);
}

PeerAccess AccessRules::of(const Peer& peer, Clock::time_point now) {
  if (peer.user != 0 && now - asked_at_ > groups_known_for) ask_groups(groups_within);
  return access_of(peer, geteuid(), groups_);
}

void AccessRules::ask_groups(Clock::duration at_most) {
  if (found_) {
    at_most = {};  // already waited for
  } else {
    found_ = std::make_shared<AccessGroups>();
    thread_.start([found = found_, asked = config_] { *found = look_up_groups(asked); });
  }
  if (!thread_.wait(at_most)) return;  // collected at the next call
  groups_ = *std::exchange(found_, nullptr);
  asked_at_ = Clock::now();
}

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

/// Pending connections; further clients wait in connect(). The kernel may allow fewer.
constexpr int backlog = 256;
/// Per connection. The kernel's default of 208 KiB would be 250 MB in total.
constexpr int send_buffer_bytes = 32 * 1024;
/// For buses, history, log and epoll.
constexpr rlim_t other_descriptors = 128;

/// Serialises the start of two daemons. The lock is on the socket's folder, so that no file is left
/// behind. Any user who can read the folder could hold it, hence the time-out of 1 s.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder)
      : fd_(open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    const timespec pause{0, 20'000'000};
    for (int i = 0; fd_ >= 0 && i < 50 && flock(fd_, LOCK_EX | LOCK_NB) != 0; ++i) {
      nanosleep(&pause, nullptr);
    }
  }
  ~FolderLock() {
    if (fd_ >= 0) close(fd_);
  }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int fd_;
};

[[noreturn]] void fail(const std::filesystem::path& path) {
  throw SocketError("status socket " + path.string() + ": " + std::strerror(errno));
}

}  // namespace

ListeningSocket::ListeningSocket(std::filesystem::path path) : path_(std::move(path)) {
  const sockaddr_un address = address_of(path_);
  const FolderLock lock(path_.parent_path());
  remove_stale();
  fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) fail(path_);
  struct stat status {};
  const bool listens =
      bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
      chmod(path_.c_str(), 0666) == 0 && listen(fd_, backlog) == 0 &&
      stat(path_.c_str(), &status) == 0;
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
    throw SocketError("status socket " + path_.string() +
                      ": a file that is not a socket exists there");
  }
  const sockaddr_un address = address_of(path_);
  const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (probe < 0) fail(path_);
  const int code = connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const bool is_refused = code != 0 && errno == ECONNREFUSED;
  struct ucred listener {};
  socklen_t size = sizeof listener;
  const bool is_known =
      code == 0 && getsockopt(probe, SOL_SOCKET, SO_PEERCRED, &listener, &size) == 0;
  close(probe);
  if (!is_refused) {
    throw SocketError("status socket " + path_.string() + ": " +
                      (is_known ? "process " + std::to_string(listener.pid) : "another daemon") +
                      " listens there already: stop it, or give this one another [socket] path");
  }
  if (unlink(path_.c_str()) != 0) fail(path_);
}

int ListeningSocket::accept_one() noexcept {
  const int fd = accept4(fd_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (fd < 0 && (errno == EMFILE || errno == ENFILE) && reserve_fd_ >= 0) {
    // Accepted and closed: a pending connection would keep the owner's loop awake.
    close(reserve_fd_);
    const int refused = accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC);
    if (refused >= 0) close(refused);
    reserve_fd_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
  }
  if (fd < 0) return fd;
  setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &send_buffer_bytes, sizeof send_buffer_bytes);
  if (fd >= FD_SETSIZE) return fd;
  const int high = fcntl(fd, F_DUPFD_CLOEXEC, FD_SETSIZE);
  if (high < 0) return fd;
  close(fd);
  return high;
}

std::size_t places_for_descriptors(std::size_t wanted) noexcept {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return std::min<std::size_t>(wanted, 64);
  const rlim_t needed = FD_SETSIZE + wanted + other_descriptors;
  if (limit.rlim_cur < needed) {
    rlimit raised = limit;
    raised.rlim_cur = std::min(limit.rlim_max, needed);
    if (setrlimit(RLIMIT_NOFILE, &raised) == 0) limit = raised;
  }
  if (limit.rlim_cur >= needed) return wanted;
  // The limit is too low: leaves half of the descriptors below FD_SETSIZE to the buses.
  const rlim_t half = std::min<rlim_t>(limit.rlim_cur, FD_SETSIZE) / 2;
  const rlim_t beyond = limit.rlim_cur > FD_SETSIZE ? limit.rlim_cur - FD_SETSIZE : 0;
  return std::min<std::size_t>(wanted, std::max(half, beyond));
}

}  // namespace thermocomp
