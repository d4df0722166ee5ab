/// The operators' door: JSON-RPC 2.0 over a Unix stream socket, one JSON object per line.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "config/daemon/daemon_config.hpp"
#include "daemon/socket/rpc.hpp"

namespace thermocomp {

struct SocketStatistics {
  std::uint64_t clients{0};  ///< connected now
  std::uint64_t accepted{0};
  std::uint64_t refused{0};  ///< not taken: no place left
  std::uint64_t requests{0};
  std::uint64_t errors{0};   ///< answered with an error
  std::uint64_t cut_off{0};  ///< ended by the server: line too long, time out, memory, place needed
  std::uint64_t delayed{0};  ///< times that a client over its rate had to wait
  std::uint64_t missed{0};   ///< notifications left out because a subscriber had not read
  std::uint64_t buffered_bytes{0};  ///< held for all clients now
};

/// What any number of clients may cost. Tests shorten the times.
struct SocketLimits {
  using Duration = std::chrono::steady_clock::duration;

  std::size_t clients_max{1200};
  std::size_t operator_places{32};  ///< of clients_max; only for who may change something
  std::size_t strangers_max{16};    ///< without any permission: one answer, then closed
  std::size_t buffered_bytes_max{std::size_t{16} << 20};  ///< for all clients together
  double requests_per_s{100.0};                           ///< of one client; above it is read later
  double requests_burst{200.0};
  double all_requests_per_s{2000.0};
  double all_requests_burst{200.0};
  Duration partial_line_max{std::chrono::seconds(10)};  ///< a line that has begun
  Duration unread_max{std::chrono::seconds(30)};        ///< an answer that is not being taken
  Duration idle_max{std::chrono::minutes(10)};          ///< no request and no subscription
  Duration stranger_max{std::chrono::seconds(5)};
  Duration replaceable_after{std::chrono::seconds(1)};  ///< idle this long: makes room for another
  Duration turn_max{std::chrono::milliseconds(10)};     ///< of handle(); one request more at most
};

/// Single-threaded; whoever owns it calls handle() when fd() is readable, or in a loop.
///
/// The socket's mode is 0666 on purpose: two groups and root reach it and a file has one group;
/// who may do what is decided for each connection from the peer's credentials as the kernel gives
/// them (user, group and supplementary groups at connect). A development daemon, not run by root
/// and without those groups on the system, takes its own user for all of them.
///
/// Fair: clients take turns, one request each; a client is read from only when its answers are
/// gone and its rate allows, so what it sends too fast waits in its own socket.
///
/// `subscribe` {"methods": ["status", ...], "period_s": 1.0}: the results of these reading methods
/// (default: status) are sent as notifications {"method": NAME, "params": RESULT} every period
/// (0.1..60 s) until the client disconnects or calls it again. A client that does not read in time
/// learns later how many it missed: {"method": "missed", "params": {"notifications": N}}.
class StatusServer {
 public:
  /// Binds and listens. A socket file nobody listens on any more is replaced. Raises the process'
  /// soft limit of open files as far as needed and allowed; with a lower one it takes fewer
  /// clients.
  /// @throws SocketError: another daemon listens there, folder missing, path too long, ...
  explicit StatusServer(const SocketConfig& config, const SocketLimits& limits = {});
  ~StatusServer();  ///< closes and removes the socket file
  StatusServer(const StatusServer&) = delete;
  StatusServer& operator=(const StatusServer&) = delete;

  void add_method(const std::string& name, AccessClass access, RpcHandler handler);
  /// While the result is awaited everybody else is served, but this client's next request is not
  /// begun.
  void add_slow_method(const std::string& name, AccessClass access, RpcSlowHandler handler);
  /// Readable when there is something to do: for the owner's epoll or poll.
  [[nodiscard]] int fd() const noexcept;
  /// Waits up to `timeout` for something to do and does it, or a part of it: what is left makes
  /// fd() readable again. Never throws because of a client.
  void handle(std::chrono::milliseconds timeout);
  [[nodiscard]] SocketStatistics statistics() const noexcept;
  /// For a handler: the user of the request in hand, as the kernel gives it; -1: not known.
  [[nodiscard]] std::int64_t caller() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
