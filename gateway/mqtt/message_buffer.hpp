/// Messages for a broker that may be away: a bounded queue that keeps the newest, and the last of
/// each topic. Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace thermocomp::gateway {

struct Message {
  std::string topic;
  std::string payload;
};

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
