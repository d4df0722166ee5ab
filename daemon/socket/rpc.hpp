/// JSON-RPC 2.0 of the status socket: error codes, permissions, handlers, and a dispatcher from a
/// request line to its answer, without socket, clock or thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "config/daemon/daemon_config.hpp"

namespace thermocomp {

/// The status socket cannot be opened.
class SocketError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Permission that a method requires; root has all.
enum class AccessClass {
  read,     ///< members of any group, and the daemon's own user
  operate,  ///< operator_group
  model,    ///< change of the model: operator_group, model_group
  bridge    ///< bridge_group
};

/// Permissions of a peer.
struct PeerAccess {
  bool read{false};
  bool operate{false};
  bool model{false};
  bool bridge{false};

  [[nodiscard]] static constexpr PeerAccess of_root() noexcept { return {true, true, true, true}; }
  [[nodiscard]] bool any() const noexcept { return read || operate || model || bridge; }
  bool operator==(const PeerAccess&) const = default;
};

namespace rpc {
inline constexpr int parse_error = -32700;
inline constexpr int invalid_request = -32600;
inline constexpr int method_not_found = -32601;
inline constexpr int invalid_params = -32602;
inline constexpr int internal_error = -32603;
inline constexpr int not_permitted = -32001;
inline constexpr int refused = -32002;  ///< valid, but not possible now (see message)
inline constexpr int cut_off =
    -32003;  ///< the connection is closed; the message names the exceeded limit
}  // namespace rpc

/// Thrown by a handler; becomes the error of the answer.
class RpcError : public std::runtime_error {
 public:
  RpcError(int code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] int code() const noexcept { return code_; }

 private:
  int code_;
};

/// Gets `params` (an object, empty if missing) and returns the result.
using RpcHandler = std::function<nlohmann::json(const nlohmann::json& params)>;

/// A delayed result: called every millisecond until complete, dropped when the client disconnects.
/// Throws as a handler does.
using RpcPending = std::function<std::optional<nlohmann::json>()>;
/// Begins an operation with a delayed result.
using RpcSlowHandler = std::function<RpcPending(const nlohmann::json& params)>;

/// A client's subscribed methods and their period.
struct Subscription {
  std::vector<std::string> methods;  ///< unique, reading methods only
  std::chrono::nanoseconds period{};
};

struct Answer {
  std::string text;  ///< one line with its end; empty for a notification of the protocol
  bool is_error{false};
  std::optional<Subscription> subscription;  ///< replaces the previous one
  /// If set, the answer is incomplete. It is called repeatedly until it has completed the answer
  /// and returns true.
  std::function<bool(Answer&)> later{};
};

/// Batches (arrays of requests) and positional parameters are refused on purpose. Unknown members
/// of a request are ignored, as JSON-RPC requires.
class RpcDispatcher {
 public:
  static constexpr std::size_t id_bytes_max = 256;
  static constexpr double period_s_min = 0.1;
  static constexpr double period_s_max = 60.0;

  explicit RpcDispatcher(const SocketConfig& config) : config_(config) {}

  void add_method(const std::string& name, AccessClass access, RpcHandler handler);
  void add_slow_method(const std::string& name, AccessClass access, RpcSlowHandler handler);
  /// @param line  any bytes; never throws because of them
  [[nodiscard]] Answer answer(const PeerAccess& access, std::string_view line) const;
  /// Notification line with the result of a reading method.
  /// @pre the method exists
  [[nodiscard]] std::string notification(const std::string& method) const;

 private:
  struct Method {
    AccessClass access{AccessClass::read};
    RpcHandler handler;  ///< exactly one of the two is set
    RpcSlowHandler slow;
  };

  [[nodiscard]] const Method& find(const PeerAccess& access, const std::string& method) const;
  [[nodiscard]] Subscription subscribe(const PeerAccess& access,
                                       const nlohmann::json& params) const;

  SocketConfig config_;
  std::map<std::string, Method, std::less<>> methods_;
};

/// An error line with id null, for no particular request.
[[nodiscard]] std::string error_line(int code, const std::string& message);
/// The line that reports missed notifications to a subscriber.
[[nodiscard]] std::string missed_line(std::uint64_t count);

}  // namespace thermocomp
