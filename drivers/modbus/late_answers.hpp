/// When a unit on a serial line may be asked again after a request without an answer. Pure; the
/// time is passed in.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace thermocomp {

/// What was asked of a unit.
struct ModbusQuestion {
  std::uint8_t function{0};
  std::uint16_t address{0};
  std::size_t answer_bytes{0};
};

/// Whether an answer to `a` could be taken for one to `b`: the answer to a read names only its
/// function and length; that to a write names what was written.
[[nodiscard]] constexpr bool confusable(const ModbusQuestion& a, const ModbusQuestion& b) noexcept {
  constexpr std::uint8_t last_read_function = 4;
  return a.function == b.function && b.function <= last_read_function &&
         a.answer_bytes == b.answer_bytes && a.address != b.address;
}

/// Modbus RTU answers carry no number: an answer that comes late looks like the answer to whatever
/// was asked of the same unit meanwhile. So the unit is left alone for a while, longer each time;
/// and once it answers although earlier requests are still owed, it is left alone for as long as
/// it may be behind. An answer to the same question is no older than `lateness_max`; another
/// question that it would also fit waits until it can no longer come. Safe for units that are late
/// by up to `lateness_max`; other units on the line need not wait, as answers name their unit.
class LateAnswers {
 public:
  using nanoseconds = std::chrono::nanoseconds;
  static constexpr nanoseconds lateness_max = std::chrono::seconds(3);
  static constexpr nanoseconds first_pause = std::chrono::seconds(1);

  /// A request sent at `sent_at` had no answer at `now`.
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

  /// Something came that is not an answer: the unit is awake, but the true answer may still come,
  /// mostly within `timeout`.
  void spoiled(const ModbusQuestion& question, nanoseconds sent_at, nanoseconds timeout) noexcept {
    question_ = question;
    others_at_ = sent_at + lateness_max;
    ready_at_ = std::max(ready_at_, sent_at + timeout);
  }

  /// A good answer arrived for the request sent at `sent_at`. If others were owed, this may be one
  /// of theirs, and the last to come is behind by no more than this one.
  void answered(nanoseconds sent_at, nanoseconds arrived_at) noexcept {
    if (owed_ != 0 && sent_at - oldest_sent_at_ <= lateness_max) {
      ready_at_ = arrived_at + std::min(arrived_at - oldest_sent_at_, 2 * lateness_max);
    }
    // It may be the answer to an earlier request; then the one to this request is still to come.
    if (sent_at < others_at_) others_at_ = sent_at + lateness_max;
    owed_ = 0;
  }

  [[nodiscard]] nanoseconds ready_at(const ModbusQuestion& question) const noexcept {
    return confusable(question_, question) ? std::max(ready_at_, others_at_) : ready_at_;
  }

 private:
  ModbusQuestion question_;   ///< that had no answer
  nanoseconds others_at_{0};  ///< until then it may still come
  nanoseconds oldest_sent_at_{0};
  nanoseconds ready_at_{0};
  nanoseconds pause_{first_pause};
  unsigned owed_{0};
};

}  // namespace thermocomp
