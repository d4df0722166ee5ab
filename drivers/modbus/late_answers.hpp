/// When may a unit on a serial line be asked again after a request without answer? Pure; the time
/// is passed in.
#pragma once

#include <algorithm>
#include <chrono>

namespace thermocomp {

/// Modbus RTU answers carry no number: an answer that comes late looks like the answer to whatever
/// was asked of the same unit meanwhile. So the unit is left alone for a while, longer each time;
/// and once it answers although earlier requests are still owed, it is left alone for as long as
/// it may be behind. Safe for units that are late by up to `lateness_max`; other units on the line
/// need not wait, as answers name their unit.
class LateAnswers {
 public:
  using nanoseconds = std::chrono::nanoseconds;
  static constexpr nanoseconds lateness_max = std::chrono::seconds(3);
  static constexpr nanoseconds first_pause = std::chrono::seconds(1);

  /// A request sent at `sent_at` had no answer at `now`.
  void unanswered(nanoseconds sent_at, nanoseconds now) noexcept {
    if (owed_ == 0 || sent_at - oldest_sent_at_ > lateness_max) {
      if (owed_ == 0) pause_ = first_pause;
      oldest_sent_at_ = sent_at;
    }
    ++owed_;
    ready_at_ = std::max(ready_at_, now + pause_);
    pause_ = std::min(2 * pause_, lateness_max);
  }

  /// The answer was spoiled: the unit is awake, but the true answer may still come within
  /// `timeout`.
  void spoiled(nanoseconds sent_at, nanoseconds timeout) noexcept {
    ready_at_ = std::max(ready_at_, sent_at + timeout);
  }

  /// A good answer arrived for the request sent at `sent_at`. If others were owed, this may be one
  /// of theirs, and the last to come is behind by no more than this one.
  void answered(nanoseconds sent_at, nanoseconds arrived_at) noexcept {
    if (owed_ != 0 && sent_at - oldest_sent_at_ <= lateness_max) {
      ready_at_ = arrived_at + std::min(arrived_at - oldest_sent_at_, 2 * lateness_max);
    }
    owed_ = 0;
  }

  [[nodiscard]] nanoseconds ready_at() const noexcept { return ready_at_; }

 private:
  nanoseconds oldest_sent_at_{0};
  nanoseconds ready_at_{0};
  nanoseconds pause_{first_pause};
  unsigned owed_{0};
};

}  // namespace thermocomp
