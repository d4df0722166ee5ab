/// Earliest time at which a unit on a serial line may be asked again after a request without
/// answer. Pure; the time is passed in.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace thermocomp {

/// A request to a unit.
struct ModbusQuestion {
  std::uint8_t function{0};
  std::uint16_t address{0};
  std::size_t answer_bytes{0};
};

/// True if an answer to `a` could be taken for one to `b`: an answer to a read contains only its
/// function and length; one to a write repeats what was written.
[[nodiscard]] constexpr bool confusable(const ModbusQuestion& a, const ModbusQuestion& b) noexcept {
  constexpr std::uint8_t last_read_function = 4;
  return a.function == b.function && b.function <= last_read_function &&
         a.answer_bytes == b.answer_bytes && a.address != b.address;
}

/// Modbus RTU answers carry no transaction id: a late answer looks like the answer to a later
/// request to the same unit. So the unit is not asked for a while, longer each time; if it answers
/// while earlier answers are outstanding, it is not asked for as long as it may lag behind. An
/// answer to the same request is at most `lateness_max` old; another request with the same form of
/// answer waits until that time is over. Safe for units late by up to `lateness_max`; other units
/// on the line need not wait, since answers carry their unit.
class LateAnswers {
 public:
  using nanoseconds = std::chrono::nanoseconds;
  static constexpr nanoseconds lateness_max = std::chrono::seconds(3);
  static constexpr nanoseconds first_pause = std::chrono::seconds(1);

  /// No answer at `now` to a request sent at `sent_at`.
  void unanswered(const ModbusQuestion& question, nanoseconds sent_at, nanoseconds now) noexcept {
    question_ = question;
    others_at_ = sent_at + lateness_max;
    if (owed_ == 0 || sent_at - oldest_sent_at_ > lateness_max) {
      if (owed_ == 0) pause_ = first_pause;
      oldest_sent_at_ = sent_at;
    }
    ++owed_;
    ready_at_ = std::max(ready_at_, now + pause_);
    pause_ = std::min(2 * pause_, lateness_max);
  }

  /// Bytes other than an answer arrived: the unit is up, but the true answer may still come, mostly
  /// within `timeout`.
  void spoiled(const ModbusQuestion& question, nanoseconds sent_at, nanoseconds timeout) noexcept {
    question_ = question;
    others_at_ = sent_at + lateness_max;
    ready_at_ = std::max(ready_at_, sent_at + timeout);
  }

  /// A good answer arrived for the request sent at `sent_at`. If others are outstanding, it may be
  /// one of theirs; the last to arrive is then no later than this one.
  void answered(nanoseconds sent_at, nanoseconds arrived_at) noexcept {
    if (owed_ != 0 && sent_at - oldest_sent_at_ <= lateness_max) {
      ready_at_ = arrived_at + std::min(arrived_at - oldest_sent_at_, 2 * lateness_max);
    }
    // It may answer an earlier request; then the answer to this one is still to come.
    if (sent_at < others_at_) others_at_ = sent_at + lateness_max;
    owed_ = 0;
  }

  [[nodiscard]] nanoseconds ready_at(const ModbusQuestion& question) const noexcept {
    return confusable(question_, question) ? std::max(ready_at_, others_at_) : ready_at_;
  }

 private:
  ModbusQuestion question_;   ///< request without answer
  nanoseconds others_at_{0};  ///< time until which its answer may come
  nanoseconds oldest_sent_at_{0};
  nanoseconds ready_at_{0};
  nanoseconds pause_{first_pause};
  unsigned owed_{0};
};

}  // namespace thermocomp
