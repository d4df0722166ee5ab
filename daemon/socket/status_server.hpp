/// The status socket's server: JSON-RPC 2.0 over a Unix stream socket, one JSON object per line.
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
  std::uint64_t refused{0};  ///< not accepted: too many clients
  std::uint64_t requests{0};
  std::uint64_t errors{0};  ///< answered with an error
  std::uint64_t cut_off{
      0};  ///< closed by the server: line too long, time-out, memory, place needed
  std::uint64_t delayed{0};         ///< times that a client had to wait for its rate limit
  std::uint64_t missed{0};          ///< notifications dropped because a subscriber had not read
  std::uint64_t buffered_bytes{0};  ///< of all clients, now
};

/// Resource limits for all clients. Tests shorten the times.
struct SocketLimits {
  using Duration = std::chrono::steady_clock::duration;

  std::size_t clients_max{1200};
  std::size_t operator_places{
      32};                        ///< of clients_max; only for clients with the operate permission
  std::size_t strangers_max{16};  ///< without any permission: one answer, then closed
  std::size_t buffered_bytes_max{std::size_t{16} << 20};  ///< of all clients together
  double requests_per_s{100.0};  ///< per client; requests above it are delayed
  double requests_burst{200.0};
  double all_requests_per_s{2000.0};
  double all_requests_burst{200.0};
  Duration partial_line_max{std::chrono::seconds(10)};  ///< incomplete line
  Duration unread_max{std::chrono::seconds(30)};        ///< answer that the client does not read
  Duration idle_max{std::chrono::minutes(10)};          ///< no request and no subscription
  Duration stranger_max{std::chrono::seconds(5)};
  Duration replaceable_after{
      std::chrono::seconds(1)};  ///< idle time after which a new client may replace it
  Duration turn_max{std::chrono::milliseconds(10)};  ///< of handle(), plus at most one request
};

/// Single-threaded: the owner calls handle() when fd() is readable, or in a loop.
///
/// The socket's mode is 0666 because a file has only one group: permissions depend on the peer's
/// credentials (user, group, supplementary groups at connect). A development daemon, not run by
/// root and without those groups on the system, grants them all to its own user.
///
/// Fair: clients take turns, one request each. A client is read only after its answers are sent and
/// if its rate allows; excess requests wait in its own socket.
///
/// `subscribe` {"methods": ["status", ...], "period_s": 1.0}: sends the results of these reading
/// methods (default: status) as notifications {"method": NAME, "params": RESULT} every period
/// (0.1..60 s) until the client disconnects or calls it again. A slow client later gets the number
/// that it missed: {"method": "missed", "params": {"notifications": N}}.
class StatusServer {
 public:
  /// Binds and listens; replaces a stale socket file. Raises the process' soft limit of open files
  /// as far as needed and allowed; with a lower limit it accepts fewer clients.
  /// @throws SocketError: another daemon listens there, folder missing, path too long, ...
  explicit StatusServer(const SocketConfig& config, const SocketLimits& limits = {});
  ~StatusServer();  ///< closes and removes the socket file
  StatusServer(const StatusServer&) = delete;
  StatusServer& operator=(const StatusServer&) = delete;

  void add_method(const std::string& name, AccessClass access, RpcHandler handler);
  /// Other clients are served while the result is pending; this client's next request waits.
  void add_slow_method(const std::string& name, AccessClass access, RpcSlowHandler handler);
  /// Readable when there is work: for the owner's epoll or poll.
  [[nodiscard]] int fd() const noexcept;
  /// Waits up to `timeout` for work and does at least part of it; any rest makes fd() readable
  /// again. Never throws because of a client.
  void handle(std::chrono::milliseconds timeout);
  [[nodiscard]] SocketStatistics statistics() const noexcept;
  /// For a handler: user ID of the present request's client, from the kernel; -1: unknown.
  [[nodiscard]] std::int64_t caller() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
