/// How fast each temperature changes, by the straight line through its last minutes.
#pragma once

#include <deque>
#include <map>
#include <string>

namespace thermocomp::gateway {

class TrendWatch {
 public:
  static constexpr double sample_every_s = 10.0;
  static constexpr double window_s = 900.0;
  static constexpr double known_after_s = 60.0;

  /// @param now_s  of a clock that does not go back; NaN values are passed over
  void add(const std::string& name, double now_s, double value);
  /// Least squares over the window, per hour; NaN while less than a minute is known.
  [[nodiscard]] double per_hour(const std::string& name) const;
  void forget() { samples_.clear(); }

 private:
  struct Sample {
    double at_s;
    double value;
  };
  std::map<std::string, std::deque<Sample>> samples_;
};

}  // namespace thermocomp::gateway
