/// Commands from the page that change something: only configured ones, for named users, executed
/// after the user has confirmed the movement.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "gateway/feed/snapshot.hpp"
#include "gateway/http/answer_thread.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

struct CommandRequest {
  std::string method{};
  std::string axis{};    ///< of prove
  std::string sensor{};  ///< of accept
  double value_um{not_a_number};
};

class PageCommands {
 public:
  static constexpr std::chrono::seconds confirmation_max{60};
  /// Limit per user; a further request drops the user's oldest.
  static constexpr std::size_t confirmations_max = 4;

  explicit PageCommands(const GatewaySettings& settings);

  /// {"user", "commands": ["enable", ...], "names": {"enable": "switch on", ...}} that this user
  /// may give.
  [[nodiscard]] nlohmann::json offered(const std::string& user) const;

  /// Two steps. {"method": "prove", "axis": "z", "value_um": 5} is answered with {"token", "text"};
  /// the text describes the movement. {"token": ...} from the same user, once, within a minute,
  /// executes it; the answer is the daemon's. Refusals: 403 user not allowed, 400 malformed, 409
  /// refused by the daemon, 410 no such token, 503 no daemon.
  [[nodiscard]] JsonAnswer take(const std::string& user, const std::string& body,
                                const Snapshot& snapshot);

 private:
  struct Asked {
    std::string user;
    std::string method;
    std::string params;  ///< JSON
    std::chrono::steady_clock::time_point until;
  };

  [[nodiscard]] bool may(const std::string& user, const std::string& method) const;
  [[nodiscard]] JsonAnswer confirm(const std::string& user, const CommandRequest& asked,
                                   const Snapshot& snapshot);
  void make_room(const std::string& user);
  [[nodiscard]] JsonAnswer carry_out(const std::string& user, const std::string& token);

  const GatewaySettings& settings_;
  std::mutex mutex_;
  std::map<std::string, Asked> waiting_;  ///< by token
};

/// Describes the movement. @throws std::invalid_argument: no such axis, no number
[[nodiscard]] std::string confirmation_text(const CommandRequest& asked, const Status& status);

}  // namespace thermocomp::gateway
