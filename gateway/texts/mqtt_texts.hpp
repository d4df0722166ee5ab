/// MQTT topics and payloads of a machine, and the buffer for a broker that is away.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gateway/alarms/alarm_watch.hpp"
#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// Unique name with allowed characters, a function of the name only: each other byte becomes `_0x`
/// and two digits ("a b" becomes a_0x20b), as does the `_` of a `_0x` in the name itself.
[[nodiscard]] std::string distinct_name(std::string_view name, bool (*is_allowed)(char));

/// `thermocomp/<machine>/<rest>`, without `/`, `+`, `#` or blanks in a name.
[[nodiscard]] std::string topic_of(const std::string& machine, const std::string& kind,
                                   const std::string& name = "");

/// Last will, also published at an orderly end: {"state": "offline"}.
[[nodiscard]] std::string offline_payload();

/// One topic and its payload without the time. Numbers are rounded to three decimals.
struct TopicState {
  std::string topic;
  nlohmann::json state;
};
/// Topics status, sensor/<name>, axis/<name>; only status while the daemon is away.
[[nodiscard]] std::vector<TopicState> topic_states(const Snapshot& snapshot,
                                                   const std::string& machine);
/// {"active": [{"name", "text", "remedy", "since_s"}], "changed": {..., "state"} or null}.
[[nodiscard]] nlohmann::json alarm_state(const std::vector<Alarm>& active,
                                         const AlarmChange* changed);
/// `state` plus "time": UTC, ISO 8601 with milliseconds.
[[nodiscard]] std::string payload_of(const nlohmann::json& state, double wall_s);
/// 2026-03-01T08:30:00.125Z
[[nodiscard]] std::string utc_text(double wall_s);

struct Message {
  std::string topic;
  std::string payload;
};

/// Messages for a broker that may be away: a bounded queue of the newest, and the last of each
/// topic. Pure.
class MessageBuffer {
 public:
  explicit MessageBuffer(std::size_t messages_max) : messages_max_(messages_max) {}

  void push(Message message) {
    newest_[message.topic] = message.payload;
    waiting_.push_back(std::move(message));
    if (waiting_.size() <= messages_max_) return;
    waiting_.pop_front();
    ++dropped_;
  }
  /// Oldest message of the queue.
  [[nodiscard]] std::optional<Message> take() {
    if (waiting_.empty()) return std::nullopt;
    Message message = std::move(waiting_.front());
    waiting_.pop_front();
    return message;
  }
  /// After a reconnection: appends the last message of each topic, so that the broker retains the
  /// current states even if messages were dropped.
  void repeat_newest() {
    for (const auto& [topic, payload] : newest_) waiting_.push_back({topic, payload});
  }
  [[nodiscard]] std::size_t size() const noexcept { return waiting_.size(); }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  std::size_t messages_max_;
  std::deque<Message> waiting_;
  std::map<std::string, std::string> newest_;
  std::uint64_t dropped_{0};
};

}  // namespace thermocomp::gateway
