/// First-order low pass with the exact step response for an input that is constant over the step.
#pragma once

#include <chrono>
#include <cmath>

#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// y += (1 - exp(-dt / tau)) (u - y), started at y = u. tau = 0 passes the input on.
class LowPass {
 public:
  explicit LowPass(double tau_s) : tau_s_(tau_s) {}

  void restart() noexcept { started_ = false; }

  /// @param now  time of `input`; must not run backwards
  double step(nanoseconds now, double input) noexcept {
    if (!started_ || !(tau_s_ > 0)) {
      value_ = input;
      started_ = true;
    } else if (now != at_) {
      if (now - at_ != step_) {
        step_ = now - at_;
        share_ = -std::expm1(-std::chrono::duration<double>(step_).count() / tau_s_);
      }
      value_ += share_ * (input - value_);
    }
    at_ = now;
    return value_;
  }

  void visit_state(StateArchive& archive) { archive(started_, at_, value_, step_, share_); }

 private:
  double tau_s_;
  bool started_{false};
  nanoseconds at_{};
  double value_{0.0};
  nanoseconds step_{};  ///< the step that share_ was computed for: exp() once, not every cycle
  double share_{0.0};
};

}  // namespace thermocomp
