#include "estimator/axes/applied_check.hpp"

#include <algorithm>

namespace thermocomp {

AppliedCheck::AppliedCheck(double tolerance_um, nanoseconds window)
    : tolerance_um_(tolerance_um),
      slot_length_(std::max(nanoseconds{1}, window / static_cast<int>(slots - 1))) {}

void AppliedCheck::restart(nanoseconds now, double offset_um) noexcept {
  state_.min_um.fill(offset_um);
  state_.max_um.fill(offset_um);
  state_.slot_until = now + slot_length_;
}

void AppliedCheck::sent(nanoseconds now, double offset_um) noexcept {
  if (now >= state_.slot_until) {
    state_.newest = (state_.newest + 1) % slots;
    state_.slot_until = now + slot_length_;
    state_.min_um[state_.newest] = offset_um;
    state_.max_um[state_.newest] = offset_um;
  }
  state_.min_um[state_.newest] = std::min(state_.min_um[state_.newest], offset_um);
  state_.max_um[state_.newest] = std::max(state_.max_um[state_.newest], offset_um);
}

double AppliedCheck::lowest_um() const noexcept {
  return *std::min_element(state_.min_um.begin(), state_.min_um.end());
}

double AppliedCheck::highest_um() const noexcept {
  return *std::max_element(state_.max_um.begin(), state_.max_um.end());
}

bool AppliedCheck::is_between(double applied_um, double low_um, double high_um) const noexcept {
  return applied_um >= low_um - tolerance_um_ && applied_um <= high_um + tolerance_um_;
}

bool AppliedCheck::agrees(double applied_um) const noexcept {
  return is_between(applied_um, lowest_um(), highest_um());
}

bool AppliedCheck::agrees_after_absence(double applied_um) const noexcept {
  return is_between(applied_um, std::min(0.0, lowest_um()), std::max(0.0, highest_um()));
}

}  // namespace thermocomp
