/// The topics of a machine, what is published on them, and what waits for a broker that is away.
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

/// A name for a place that allows fewer characters. Two names never become alike, and what a name
/// becomes depends on it alone: each byte that is not allowed is `_0x` and two digits ("a b" is
/// a_0x20b), and so is the `_` of a `_0x` that a name has itself.
[[nodiscard]] std::string distinct_name(std::string_view name, bool (*is_allowed)(char));

/// `thermocomp/<machine>/<rest>`; a topic's name has neither `/`, `+`, `#` nor blanks.
[[nodiscard]] std::string topic_of(const std::string& machine, const std::string& kind,
                                   const std::string& name = "");

/// The last will, and what is said at an orderly end: {"state": "offline"}.
[[nodiscard]] std::string offline_payload();

/// One topic and its payload without the time. Numbers have three decimals: less is noise.
struct TopicState {
  std::string topic;
  nlohmann::json state;
};
/// status, sensor/<name>, axis/<name>. While the daemon is away only status.
[[nodiscard]] std::vector<TopicState> topic_states(const Snapshot& snapshot,
                                                   const std::string& machine);
/// {"active": [{"name", "text", "remedy", "since_s"}], "changed": {..., "state"} or null}.
[[nodiscard]] nlohmann::json alarm_state(const std::vector<Alarm>& active,
                                         const AlarmChange* changed);
/// `state` and "time": UTC, ISO 8601 with milliseconds.
[[nodiscard]] std::string payload_of(const nlohmann::json& state, double wall_s);
/// 2026-03-01T08:30:00.125Z
[[nodiscard]] std::string utc_text(double wall_s);

struct Message {
  std::string topic;
  std::string payload;
};

/// Messages for a broker that may be away: a bounded queue that keeps the newest, and the last of
/// each topic. Pure.
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
  /// The next to be sent, oldest first.
  [[nodiscard]] std::optional<Message> take() {
    if (waiting_.empty()) return std::nullopt;
    Message message = std::move(waiting_.front());
    waiting_.pop_front();
    return message;
  }
  /// After a connection was made anew: behind what waits, the last of each topic once more, so that
  /// what the broker retains is right even where the queue had to drop.
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
