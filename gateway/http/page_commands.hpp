/// Commands that change something, from the page: only those that are configured, for named users,
/// and carried out when the user has confirmed what will move.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "gateway/door/answer_thread.hpp"
#include "gateway/feed/snapshot.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

/// What a page asks for.
struct CommandRequest {
  std::string method{};
  std::string axis{};    ///< of prove
  std::string sensor{};  ///< of accept
  double value_um{not_a_number};
};

class PageCommands {
 public:
  static constexpr std::chrono::seconds confirmation_max{60};
  /// Of one user; beyond them the oldest of the same user counts no more.
  static constexpr std::size_t confirmations_max = 4;

  explicit PageCommands(const GatewaySettings& settings);

  /// {"user", "commands": ["enable", ...]}: what this user may ask for.
  [[nodiscard]] nlohmann::json offered(const std::string& user) const;

  /// Two steps. {"method": "prove", "axis": "z", "value_um": 5} is answered {"token", "text"}; the
  /// text says what will move. {"token": ...} of the same user, once, within a minute, does it: the
  /// answer has the daemon's. Refusals: 403 not for this user, 400 not understood, 409 refused by
  /// the daemon, 410 no such token, 503 no daemon.
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

/// What the command will move, in words. @throws std::invalid_argument: no such axis, no number
[[nodiscard]] std::string confirmation_text(const CommandRequest& asked, const Status& status);

}  // namespace thermocomp::gateway
