/// The words of the status socket: error codes, who may call what, what a handler is.
#pragma once

#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp {

/// Who may call a method. root always may.
enum class AccessClass {
  read,     ///< read_group, operator_group, bridge_group, and the daemon's own user
  operate,  ///< operator_group
  bridge    ///< bridge_group
};

/// What a peer may do.
struct PeerAccess {
  bool read{false};
  bool operate{false};
  bool bridge{false};

  [[nodiscard]] bool any() const noexcept { return read || operate || bridge; }
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

}  // namespace thermocomp
