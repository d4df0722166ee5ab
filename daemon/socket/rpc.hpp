/// The words of the status socket: error codes, who may call what, what a handler is; and from a
/// line of bytes to the line that answers it, JSON-RPC 2.0 without socket, clock or thread.
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

/// Why the operators' socket cannot be opened.
class SocketError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Who may call a method. root always may.
enum class AccessClass {
  read,     ///< the members of any group, and the daemon's own user
  operate,  ///< operator_group
  model,    ///< which model runs: operator_group, model_group
  bridge    ///< bridge_group
};

/// What a peer may do.
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
inline constexpr int refused = -32002;  ///< understood, but not now (the message says why)
inline constexpr int cut_off = -32003;  ///< the connection ends; the message says for which limit
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

/// A result that takes time: called every millisecond until it is there, and forgotten when the
/// client has gone. May throw what a handler throws.
using RpcPending = std::function<std::optional<nlohmann::json>()>;
/// Begins what was asked for.
using RpcSlowHandler = std::function<RpcPending(const nlohmann::json& params)>;

/// What a client subscribes to, and how often.
struct Subscription {
  std::vector<std::string> methods;  ///< each once, reading methods only
  std::chrono::nanoseconds period{};
};

struct Answer {
  std::string text;  ///< one line with its end; empty: none is due (the protocol's "notification")
  bool is_error{false};
  std::optional<Subscription> subscription;  ///< takes the place of the one before
  /// If set, nothing else is there yet. It is called again and again; once it returns true, the
  /// answer it was given is complete.
  std::function<bool(Answer&)> later{};
};

/// Not supported on purpose, and refused in words: batches (an array of requests; several lines do
/// the same) and parameters by position. Members of a request that JSON-RPC does not know are
/// ignored, as it asks.
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
  /// The line that tells a subscriber the result of a reading method.
  /// @pre the method exists
  [[nodiscard]] std::string notification(const std::string& method) const;

 private:
  struct Method {
    AccessClass access{AccessClass::read};
    RpcHandler handler;  ///< one of the two
    RpcSlowHandler slow;
  };

  [[nodiscard]] const Method& find(const PeerAccess& access, const std::string& method) const;
  [[nodiscard]] Subscription subscribe(const PeerAccess& access,
                                       const nlohmann::json& params) const;

  SocketConfig config_;
  std::map<std::string, Method, std::less<>> methods_;
};

/// A line with an error that answers no request in particular (id null).
[[nodiscard]] std::string error_line(int code, const std::string& message);
/// A line that tells a subscriber how many notifications it did not get because it did not read.
[[nodiscard]] std::string missed_line(std::uint64_t count);

}  // namespace thermocomp
