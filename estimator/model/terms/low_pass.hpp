/// First-order low pass, exact for an input that is constant over the step, and its inverse.
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
  nanoseconds step_{};  ///< step length of share_, so that exp() is called only when it changes
  double share_{0.0};
};

/// T = r + tau d/dt LP_f(r), the inverse of a reading r that follows T with the time constant tau.
/// The derivative is that of the reading smoothed with tau_f = tau / 4, which multiplies the noise
/// of single readings by at most 1 + tau / tau_f = 5 and leaves an error of tau tau_f T''. The
/// first step, and tau = 0, pass the reading on.
class Lead {
 public:
  explicit Lead(double tau_s) : tau_s_(tau_s), smooth_(smoothing_share * tau_s) {}

  void restart() noexcept {
    started_ = false;
    smooth_.restart();
  }

  /// @param now  time of `reading`; must not run backwards
  double step(nanoseconds now, double reading) noexcept {
    const double smooth = smooth_.step(now, reading);
    if (!started_)
      slope_per_s_ = 0.0;
    else if (now != at_)
      slope_per_s_ = (smooth - before_) / std::chrono::duration<double>(now - at_).count();
    started_ = true;
    at_ = now;
    before_ = smooth;
    return reading + tau_s_ * slope_per_s_;
  }

  void visit_state(StateArchive& archive) {
    archive(smooth_, started_, at_, before_, slope_per_s_);
  }

 private:
  static constexpr double smoothing_share = 0.25;

  double tau_s_;
  LowPass smooth_;
  bool started_{false};
  nanoseconds at_{};
  double before_{0.0};
  double slope_per_s_{0.0};
};

}  // namespace thermocomp
