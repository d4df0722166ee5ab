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

bool AppliedCheck::agrees(double applied_um) const noexcept {
  const double low_um = *std::min_element(min_um_.begin(), min_um_.end()) - tolerance_um_;
  const double high_um = *std::max_element(max_um_.begin(), max_um_.end()) + tolerance_um_;
  return applied_um >= low_um && applied_um <= high_um;
}

void AppliedCheck::adopt(const AppliedCheck& previous) noexcept {
  min_um_ = previous.min_um_;
  max_um_ = previous.max_um_;
  newest_ = previous.newest_;
  slot_until_ = previous.slot_until_;
}

}  // namespace thermocomp
