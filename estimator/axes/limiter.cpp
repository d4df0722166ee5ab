#include "estimator/axes/limiter.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp {

Limiter::Limiter(const LimiterConfig& config)
    : bound_um_(config.offset_um_max), rate_um_per_s_(config.rate_um_per_s_max) {
  config.validate();
}

void Limiter::step(double target_um, double dt_s) noexcept {
  constexpr double dt_s_max = 1.0;
  const double wanted_um = std::isfinite(target_um) ? target_um : offset_um_;
  const double bounded_um = std::clamp(wanted_um, -bound_um_, bound_um_);
  at_bound_ = bounded_um != wanted_um;
  if (!(dt_s > 0)) return;
  const double step_um_max = rate_um_per_s_ * std::min(dt_s, dt_s_max);
  const double way_um = bounded_um - offset_um_;
  // Lands on the target exactly, so that a settled offset equals it to the last bit.
  offset_um_ = std::abs(way_um) <= step_um_max ? bounded_um
                                               : offset_um_ + std::copysign(step_um_max, way_um);
}

}  // namespace thermocomp
