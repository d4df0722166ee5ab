#include "estimator/applied_check.hpp"

#include <algorithm>

namespace thermocomp {

AppliedCheck::AppliedCheck(double tolerance_um, nanoseconds window)
    : tolerance_um_(tolerance_um),
      slot_length_(std::max(nanoseconds{1}, window / static_cast<int>(slots - 1))) {}

void AppliedCheck::restart(nanoseconds now, double offset_um) noexcept {
  min_um_.fill(offset_um);
  max_um_.fill(offset_um);
  slot_until_ = now + slot_length_;
}

void AppliedCheck::sent(nanoseconds now, double offset_um) noexcept {
  if (now >= slot_until_) {
    newest_ = (newest_ + 1) % slots;
    slot_until_ = now + slot_length_;
    min_um_[newest_] = offset_um;
    max_um_[newest_] = offset_um;
  }
  min_um_[newest_] = std::min(min_um_[newest_], offset_um);
  max_um_[newest_] = std::max(max_um_[newest_], offset_um);
}

double AppliedCheck::lowest_um() const noexcept {
  return *std::min_element(min_um_.begin(), min_um_.end());
}

double AppliedCheck::highest_um() const noexcept {
  return *std::max_element(max_um_.begin(), max_um_.end());
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

void AppliedCheck::adopt(const AppliedCheck& previous) noexcept {
  min_um_ = previous.min_um_;
  max_um_ = previous.max_um_;
  newest_ = previous.newest_;
  slot_until_ = previous.slot_until_;
}

}  // namespace thermocomp
