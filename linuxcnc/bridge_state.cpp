// SPDX-License-Identifier: GPL-2.0-or-later
#include "linuxcnc/bridge_state.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace thermocomp_linuxcnc {

BridgeState::BridgeState(std::size_t axes, const Limits& limits) : limits_(limits), axes_(axes) {}

void BridgeState::ask(Axis& axis, double offset_mm) {
  axis.asked_mm = offset_mm;
  axis.changed = true;
}

void BridgeState::take(const Answer& answer, const MachineView& reported, nanoseconds now) {
  answered_at_ = now;
  outputs_.heartbeat = !outputs_.heartbeat;
  if (answer.all_driven) driven_at_ = now;
  mode_ = answer.mode;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const double applied_mm = reported.axes[i].applied_mm;
    if (reported.taking && answer.offset_mm[i])
      ask(axes_[i], *answer.offset_mm[i]);
    else if (reported.taking && answer.anew && std::isfinite(applied_mm))
      ask(axes_[i], std::clamp(applied_mm, -limits_.offset_mm_max, limits_.offset_mm_max));
  }
}

bool BridgeState::is_fresh(const std::optional<nanoseconds>& time, nanoseconds now) const {
  return time && std::chrono::duration<double>(now - *time).count() <= limits_.fresh_s;
}

bool BridgeState::lasts(const std::optional<nanoseconds>& since, nanoseconds now) const {
  return since && std::chrono::duration<double>(now - *since).count() > limits_.mismatch_after_s;
}

void BridgeState::compare(Axis& axis, const AxisView& view, nanoseconds now) {
  const auto is_near = [&](double mm) {
    return std::abs(mm - *axis.asked_mm) <= limits_.mismatch_mm;  // false for NaN
  };
  if (!axis.asked_mm || (is_near(view.applied_mm) && is_near(view.wanted_mm)))
    axis.apart_since.reset();
  else if (!axis.apart_since)
    axis.apart_since = now;
}

Outputs BridgeState::show(const MachineView& view, nanoseconds now) {
  outputs_.offset_mm.assign(axes_.size(), std::nullopt);
  outputs_.mismatch = false;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    Axis& axis = axes_[i];
    if (!view.taking) ask(axis, 0.0);
    if (std::exchange(axis.changed, false)) outputs_.offset_mm[i] = axis.asked_mm;
    if (view.taking)
      compare(axis, view.axes[i], now);
    else
      axis.apart_since.reset();
    outputs_.mismatch = outputs_.mismatch || lasts(axis.apart_since, now);
    const AxisView& shown = view.axes[i];
    if (!std::isfinite(shown.applied_mm + shown.wanted_mm + shown.position_mm)) fault();
  }
  if (!std::isfinite(view.spindle_rpm)) fault();
  outputs_.fresh = is_fresh(answered_at_, now);
  outputs_.compensating = is_fresh(driven_at_, now) && view.taking && mode_ == "compensating";
  // No warning if an operator has switched it off.
  if (!view.taking || outputs_.compensating || mode_ == "disabled")
    idle_since_.reset();
  else if (!idle_since_)
    idle_since_ = now;
  outputs_.warning = !outputs_.fresh || outputs_.mismatch || lasts(idle_since_, now);
  return outputs_;
}

}  // namespace thermocomp_linuxcnc
