/// Rate-independent play (backlash) of a joint.
#pragma once

#include <algorithm>

#include "estimator/state_archive.hpp"

namespace thermocomp {

/// y = min(max(y, u - w/2), u + w/2), started at y = u in the middle of the play. `w`: full width
/// of the dead band, in the unit of the input.
class Play {
 public:
  explicit Play(double width) : half_width_(0.5 * width) {}

  void restart() noexcept { started_ = false; }

  double step(double input) noexcept {
    value_ =
        started_ ? std::min(std::max(value_, input - half_width_), input + half_width_) : input;
    started_ = true;
    return value_;
  }

  void visit_state(StateArchive& archive) { archive(started_, value_); }

 private:
  double half_width_;
  bool started_{false};
  double value_{0.0};
};

}  // namespace thermocomp
