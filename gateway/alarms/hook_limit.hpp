/// Not more than so many an hour, whatever happens. Pure.
#pragma once

#include <deque>

namespace thermocomp::gateway {

class HookLimit {
 public:
  explicit HookLimit(unsigned per_hour_max) : per_hour_max_(per_hour_max) {}
  /// Whether one more may begin now; if so it is counted.
  [[nodiscard]] bool take(double now_s) {
    constexpr double hour_s = 3600.0;
    while (!begun_s_.empty() && now_s - begun_s_.front() >= hour_s) begun_s_.pop_front();
    if (begun_s_.size() >= per_hour_max_) return false;
    begun_s_.push_back(now_s);
    return true;
  }

 private:
  unsigned per_hour_max_;
  std::deque<double> begun_s_;
};

}  // namespace thermocomp::gateway
