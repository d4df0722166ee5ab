/// A bound on how many things happen per second, and at once after a pause.
#pragma once

#include <algorithm>
#include <chrono>

namespace thermocomp {

/// Level l grows with `per_s` up to `burst`; taking needs l >= 1. Time is an argument.
class TokenBucket {
 public:
  using Clock = std::chrono::steady_clock;

  TokenBucket(double per_s, double burst) : per_s_(per_s), burst_(burst), level_(burst) {}

  [[nodiscard]] bool try_take(Clock::time_point now) noexcept {
    refill(now);
    if (!(level_ >= 1.0)) return false;
    level_ -= 1.0;
    return true;
  }
  void give_back() noexcept { level_ += 1.0; }
  /// The earliest time at which one can be taken.
  [[nodiscard]] Clock::time_point next(Clock::time_point now) noexcept {
    refill(now);
    if (level_ >= 1.0) return now;
    return now + std::chrono::ceil<Clock::duration>(
                     std::chrono::duration<double>((1.0 - level_) / per_s_));
  }

 private:
  void refill(Clock::time_point now) noexcept {
    const double passed_s = std::chrono::duration<double>(now - filled_at_).count();
    filled_at_ = now;
    if (passed_s > 0.0) level_ = std::min(burst_, level_ + per_s_ * passed_s);
  }

  double per_s_;
  double burst_;
  double level_;
  Clock::time_point filled_at_{};
};

}  // namespace thermocomp
