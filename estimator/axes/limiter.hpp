/// Bound and slew of one axis: whatever the target does, the offset does not jump.
#pragma once

#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// offset += clamp(clamp(target, +-bound) - offset, +-rate dt). An offset that starts outside the
/// bound (a smaller bound after a reload) comes in at the rate.
class Limiter {
 public:
  explicit Limiter(const LimiterConfig& config);  ///< @throws InvalidValue

  /// @param target_um  where to go; NaN or infinite: stay
  /// @param dt_s       time since the last step; used up to 1 s, so that a cycle that comes back
  ///                   after a long overrun makes no leap
  void step(double target_um, double dt_s) noexcept;
  /// Starts from what is applied; the only way the offset may jump, because the axis is there.
  void start_from(double offset_um) noexcept { offset_um_ = offset_um; }

  [[nodiscard]] double offset_um() const noexcept { return offset_um_; }
  [[nodiscard]] double bound_um() const noexcept { return bound_um_; }
  [[nodiscard]] double rate_um_per_s() const noexcept { return rate_um_per_s_; }
  /// Whether the last target lay outside the bound.
  [[nodiscard]] bool at_bound() const noexcept { return at_bound_; }
  void visit_state(StateArchive& archive) { archive(offset_um_, at_bound_); }

 private:
  double bound_um_;
  double rate_um_per_s_;
  double offset_um_{0.0};
  bool at_bound_{false};
};

}  // namespace thermocomp
