#include "estimator/learning/heat_phase.hpp"

#include <chrono>
#include <cmath>

namespace thermocomp {

void HeatPhase::step(nanoseconds now, double heat_um, double displacement_um) noexcept {
  const double size_um = std::abs(heat_um);
  State& s = state_;
  if (!s.started) s = {true, true, false, now, now, size_um, now, displacement_um, 0.0};
  s.now = now;
  if (s.heating ? size_um >= s.heat_extreme_um : size_um <= s.heat_extreme_um) {
    s.heat_extreme_um = size_um;
    s.extreme_at = now;
  }
  if (std::abs(size_um - s.heat_extreme_um) > back_um_) {
    s.heating = !s.heating;
    s.changed_at = s.extreme_at;
    s.heat_extreme_um = size_um;
    s.extreme_at = now;
    s.turned = false;
    s.began_um = displacement_um;
    s.away_um = 0.0;
  }
  const double away_um = std::abs(displacement_um - s.began_um);
  if (away_um > s.away_um) s.away_um = away_um;
  if (s.heating && s.away_um - away_um > back_um_) s.turned = true;
}

CoursePhase HeatPhase::phase() const noexcept {
  if (!state_.heating) return CoursePhase::cooling;
  return state_.turned ? CoursePhase::turned : CoursePhase::heating;
}

double HeatPhase::since_s() const noexcept {
  return std::chrono::duration<double>(state_.now - state_.changed_at).count();
}

}  // namespace thermocomp
