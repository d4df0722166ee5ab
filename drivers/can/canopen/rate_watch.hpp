/// Whether a message comes more often than its one sender sends it. Pure.
#pragma once

#include <chrono>

namespace thermocomp {

using std::chrono::nanoseconds;

/// Counts arrivals in windows of eight periods. Two senders put sixteen into one; more than twelve
/// are taken for that, until a window has few enough again. A sender that makes up for a pause
/// stays below.
class RateWatch {
 public:
  static constexpr int periods = 8;
  static constexpr int arrivals_max = 12;

  /// @param period  zero: nothing is ever too often
  explicit RateWatch(nanoseconds period = nanoseconds{0}) noexcept : window_(periods * period) {}

  void arrived(nanoseconds at) noexcept {
    if (window_ == nanoseconds{0}) return;
    advance(at);
    if (++count_ > arrivals_max) too_often_ = true;
  }
  void advance(nanoseconds now) noexcept {
    if (window_ == nanoseconds{0} || now < begin_ + window_) return;
    if (count_ <= arrivals_max) too_often_ = false;
    begin_ = now;
    count_ = 0;
  }
  void forget() noexcept {
    count_ = 0;
    too_often_ = false;
  }
  [[nodiscard]] bool too_often() const noexcept { return too_often_; }

 private:
  nanoseconds window_;
  nanoseconds begin_{};
  int count_{0};
  bool too_often_{false};
};

}  // namespace thermocomp
