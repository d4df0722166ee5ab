/// The operators' door: JSON-RPC 2.0 over a Unix stream socket, one JSON object a line.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "config/daemon_config.hpp"

namespace thermocomp {

class SocketError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Who may call a method. root always may.
enum class AccessClass {
  read,     ///< read_group, operator_group, bridge_group, and the daemon's own user
  operate,  ///< operator_group
  bridge    ///< bridge_group
};

namespace rpc {
inline constexpr int parse_error = -32700;
inline constexpr int invalid_request = -32600;
inline constexpr int method_not_found = -32601;
inline constexpr int invalid_params = -32602;
inline constexpr int internal_error = -32603;
inline constexpr int not_permitted = -32001;
inline constexpr int refused = -32002;  ///< understood, but not now (the message says why)
}  // namespace rpc

/// Thrown by a handler: becomes the error of the answer.
class RpcError : public std::runtime_error {
 public:
  RpcError(int code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] int code() const noexcept { return code_; }

 private:
  int code_;
};

/// Gets `params` (an object; an empty one where the request has none), returns the result.
using RpcHandler = std::function<nlohmann::json(const nlohmann::json& params)>;

struct SocketStatistics {
  std::uint64_t clients{0};  ///< connected now
  std::uint64_t accepted{0};
  std::uint64_t refused{0};  ///< beyond clients_max
  std::uint64_t requests{0};
  std::uint64_t errors{0};   ///< answered with an error
  std::uint64_t dropped{0};  ///< clients cut off: too slow, line too long
};

/// Single-threaded; whoever owns it calls handle() when fd() is readable, or in a loop.
///
/// The socket's mode is 0666 on purpose: two groups and root reach it and a file has one group;
/// who may do what is decided for each connection from the peer's credentials as the kernel gives
/// them (user, group and supplementary groups at connect). A development daemon, not run by root
/// and without those groups on the system, takes its own user for all of them.
///
/// `subscribe` {"methods": ["status", ...], "period_s": 1.0}: the results of these reading methods
/// (default: status) are sent as notifications {"method": NAME, "params": RESULT} every period
/// (0.1..60 s) until the client disconnects or calls it again.
class StatusServer {
 public:
  static constexpr std::size_t line_bytes_max = std::size_t{64} * 1024;
  static constexpr std::size_t clients_max = 64;
  static constexpr std::size_t output_bytes_max = 4u << 20;  ///< waiting for a slow reader

  /// Binds and listens. A socket file nobody listens on any more is replaced.
  /// @throws SocketError: another daemon listens there, folder missing, path too long, ...
  explicit StatusServer(const SocketConfig& config);
  ~StatusServer();  ///< closes and removes the socket file
  StatusServer(const StatusServer&) = delete;
  StatusServer& operator=(const StatusServer&) = delete;

  void add_method(const std::string& name, AccessClass access, RpcHandler handler);
  /// Readable when there is something to do: for the owner's epoll or poll.
  [[nodiscard]] int fd() const noexcept;
  /// Waits up to `timeout` for something to do and does it. Throws nothing of a client's making.
  void handle(std::chrono::milliseconds timeout);
  [[nodiscard]] SocketStatistics statistics() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
