#include "simulator/devices/simulated_cnc.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"

namespace thermocomp {

SimulatedCnc::SimulatedCnc(const SimulatedController& config)
    : config_(config), wanted_um_(config.axes.size(), 0.0), applied_um_(config.axes.size(), 0.0) {
  const bool watched =
      (config.heartbeat || config.can_heartbeat) && config.heartbeat_timeout_s > 0.0;
  if (!watched) config_.heartbeat_timeout_s = 0.0;
  for (const SimulatedAxis& axis : config.axes) {
    auto& piezo = piezos_.emplace_back();
    if (axis.piezo) piezo.emplace(*axis.piezo);
  }
}

void SimulatedCnc::take(double now_s, const CncOrder& order) {
  THERMOCOMP_ENSURE(order.offset_um.size() == wanted_um_.size());
  const bool beat = told_ && order.heartbeat != heartbeat_;
  heartbeat_ = order.heartbeat;
  told_ = true;
  if (beat) {
    beaten_ = true;
    beat_at_s_ = now_s;
  }
  alive_ = config_.heartbeat_timeout_s <= 0.0 ||
           (beaten_ && now_s - beat_at_s_ <= config_.heartbeat_timeout_s);
  if (!alive_ || rejects_) return;
  for (std::size_t i = 0; i < wanted_um_.size(); ++i) {
    const double offset = order.offset_um[i];
    const double bound = config_.axes[i].offset_um_max;
    const bool valid = i < 64 && ((order.valid_bits >> i) & 1) != 0;
    if (valid && std::isfinite(offset) && (bound <= 0.0 || std::abs(offset) <= bound)) {
      wanted_um_[i] = offset;
    }
  }
}

bool SimulatedCnc::step(double now_s, const ControllerEffect& effect) {
  const double dt_s = std::max(0.0, now_s - stepped_at_s_);
  stepped_at_s_ = now_s;
  rejects_ = effect.rejects;
  const bool homed = effect.rehomings != rehomings_;
  if (homed) {
    rehomings_ = effect.rehomings;
    forget();
  }
  if (config_.heartbeat_timeout_s > 0.0) {
    alive_ = beaten_ && now_s - beat_at_s_ <= config_.heartbeat_timeout_s;
    if (!alive_) return homed;
  }
  for (std::size_t i = 0; i < applied_um_.size(); ++i) {
    const double goal = wanted_um_[i] + effect.misapplied_um;
    const double share = config_.tau_s > 0.0 ? -std::expm1(-dt_s / config_.tau_s) : 1.0;
    double change = share * (goal - applied_um_[i]);
    const double rate = config_.axes[i].rate_um_per_s_max;
    if (rate > 0.0) change = std::clamp(change, -rate * dt_s, rate * dt_s);
    applied_um_[i] += change;
    if (piezos_[i]) piezos_[i]->step(applied_um_[i]);
  }
  return homed;
}

void SimulatedCnc::forget() {
  std::fill(wanted_um_.begin(), wanted_um_.end(), 0.0);
  std::fill(applied_um_.begin(), applied_um_.end(), 0.0);
  for (auto& piezo : piezos_)
    if (piezo) piezo->step(0.0);
}

}  // namespace thermocomp
