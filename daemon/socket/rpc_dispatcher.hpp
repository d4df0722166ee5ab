/// From a line of bytes to the line that answers it: JSON-RPC 2.0 without socket, clock or thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/daemon/daemon_config.hpp"
#include "daemon/socket/rpc.hpp"

namespace thermocomp {

/// What a client wants to be told, and how often.
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
