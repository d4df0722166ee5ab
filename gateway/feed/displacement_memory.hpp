/// The displacement of the last hours. The daemon's history has offsets, which follow it within
/// slew and bound; the displacement itself is only told live.
#pragma once

#include <cstddef>
#include <deque>
#include <string>
#include <vector>

#include "status/status.hpp"

namespace thermocomp::gateway {

class DisplacementMemory {
 public:
  static constexpr double sample_every_s = 10.0;
  static constexpr std::size_t samples_max = 4320;  ///< twelve hours

  /// Other axes than before: all is forgotten.
  void add(double wall_s, const std::vector<AxisStatus>& now);
  [[nodiscard]] const std::vector<std::string>& axes() const noexcept { return axes_; }
  /// Mean of an axis over each span [times[i] - span_s / 2, times[i] + span_s / 2); NaN: unknown.
  [[nodiscard]] std::vector<double> over(std::size_t axis, const std::vector<double>& times_s,
                                         double span_s) const;

 private:
  struct Sample {
    double wall_s;
    std::vector<float> values;
  };
  std::vector<std::string> axes_;
  std::deque<Sample> samples_;
};

}  // namespace thermocomp::gateway
