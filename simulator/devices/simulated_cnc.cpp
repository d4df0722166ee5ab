#include "simulator/devices/simulated_cnc.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"

namespace thermocomp {

SimulatedPiezo::SimulatedPiezo(const SimulatedPiezoConfig& config) : config_(config) {
  THERMOCOMP_ENSURE(config.curve_V.size() >= 2 && config.curve_V.size() == config.curve_um.size());
}

double SimulatedPiezo::step(double volt) noexcept {
  felt_V_ = std::max(felt_V_, volt - config_.dead_band_V);
  felt_V_ = std::min(felt_V_, std::max(volt, 0.0));
  return displacement_um();
}

double SimulatedPiezo::displacement_um() const noexcept {
  const auto& [dead_band_V, at_V, um] = config_;
  const auto above = std::upper_bound(at_V.begin(), at_V.end(), felt_V_);
  if (above == at_V.begin()) return um.front();
  if (above == at_V.end()) return um.back();
  const auto next = static_cast<std::size_t>(above - at_V.begin());
  const double share = (felt_V_ - at_V[next - 1]) / (at_V[next] - at_V[next - 1]);
  return um[next - 1] + share * (um[next] - um[next - 1]);
}

SimulatedCnc::SimulatedCnc(const SimulatedController& config)
    : config_(config),
      tool_um_(config.axes.size(), 0.0),
      looked_at_s_(config.axes.size(), 0.0),
      set_numbers_(config.axes.size(), 0) {
  std::size_t offsets = 0;
  for (const SimulatedAxis& axis : config.axes) {
    first_.push_back(offsets);
    offsets += axis.offsets();
  }
  wanted_um_.assign(offsets, 0.0);
  applied_um_.assign(offsets, 0.0);
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
  const bool beat = has_order_ && order.heartbeat != heartbeat_;
  heartbeat_ = order.heartbeat;
  has_order_ = true;
  if (beat) {
    beaten_ = true;
    beat_at_s_ = now_s;
  }
  alive_ = config_.heartbeat_timeout_s <= 0.0 ||
           (beaten_ && now_s - beat_at_s_ <= config_.heartbeat_timeout_s);
  if (!alive_ || rejects_) return;
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) take_axis(axis, order);
}

void SimulatedCnc::take_axis(std::size_t axis, const CncOrder& order) {
  const double bound = config_.axes[axis].offset_um_max;
  const bool valid = axis < 64 && ((order.valid_bits >> axis) & 1) != 0;
  const auto begin = order.offset_um.begin() + static_cast<std::ptrdiff_t>(first_[axis]);
  const auto end = begin + static_cast<std::ptrdiff_t>(config_.axes[axis].offsets());
  const bool good = std::all_of(begin, end, [bound](double offset) {
    return std::isfinite(offset) && (bound <= 0.0 || std::abs(offset) <= bound);
  });
  if (!valid || !good) return;
  std::copy(begin, end, wanted_um_.begin() + static_cast<std::ptrdiff_t>(first_[axis]));
  if (axis < order.set_numbers.size()) set_numbers_[axis] = order.set_numbers[axis];
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
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis)
    step_axis(axis, dt_s, effect.misapplied_um);
  return homed;
}

void SimulatedCnc::step_axis(std::size_t axis, double dt_s, double misapplied_um) {
  const SimulatedAxis& config = config_.axes[axis];
  const double share = config_.tau_s > 0.0 ? -std::expm1(-dt_s / config_.tau_s) : 1.0;
  const double rate = config.rate_um_per_s_max;
  for (std::size_t i = first_[axis]; i < first_[axis] + config.offsets(); ++i) {
    const double goal = wanted_um_[i] + misapplied_um;
    double change = share * (goal - applied_um_[i]);
    if (rate > 0.0) change = std::clamp(change, -rate * dt_s, rate * dt_s);
    applied_um_[i] += change;
  }
  if (piezos_[axis]) piezos_[axis]->step(applied_um_[first_[axis]]);
}

void SimulatedCnc::set_position(std::size_t axis, double now_s, double position_mm) {
  const double dt_s = std::max(0.0, now_s - looked_at_s_.at(axis));
  looked_at_s_[axis] = now_s;
  const double rate = config_.axes[axis].travel->interpolation_um_per_s_max;
  double change = between_nodes_um(axis, position_mm) - tool_um_[axis];
  if (rate > 0.0) change = std::clamp(change, -rate * dt_s, rate * dt_s);
  tool_um_[axis] += change;
}

/// A line is extrapolated beyond its travel, a table is not.
double SimulatedCnc::between_nodes_um(std::size_t axis, double position_mm) const {
  const TravelShape& travel = config_.axes[axis].travel->shape();
  const std::vector<double>& nodes_mm = travel.nodes_mm;
  const std::span<const double> nodes_um = nodes(axis);
  std::size_t above = 1;
  while (above + 1 < nodes_mm.size() && position_mm > nodes_mm[above]) ++above;
  double share = (position_mm - nodes_mm[above - 1]) / (nodes_mm[above] - nodes_mm[above - 1]);
  if (!travel.p0_mm) share = std::clamp(share, 0.0, 1.0);
  return nodes_um[above - 1] + share * (nodes_um[above] - nodes_um[above - 1]);
}

void SimulatedCnc::forget() {
  std::fill(wanted_um_.begin(), wanted_um_.end(), 0.0);
  std::fill(applied_um_.begin(), applied_um_.end(), 0.0);
  std::fill(tool_um_.begin(), tool_um_.end(), 0.0);
  std::fill(set_numbers_.begin(), set_numbers_.end(), 0);
  for (auto& piezo : piezos_)
    if (piezo) piezo->step(0.0);
}

}  // namespace thermocomp
