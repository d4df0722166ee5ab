#include "drivers/controllers/kinds/modbus/piezo_drive.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

namespace thermocomp {
namespace {

/// Smaller differences are rounding of a register, not movement.
constexpr double still_um = 0.01;
/// Response time of amplifier and read-back, in addition to the time at 0 V.
constexpr double amplifier_s = 0.5;

/// y over x, linear between points, constant beyond; x strictly increases.
double between(const std::vector<double>& x, const std::vector<double>& y, double at) noexcept {
  if (std::isnan(at)) return at;
  if (at <= x.front()) return y.front();
  if (at >= x.back()) return y.back();
  const auto above = static_cast<std::size_t>(std::upper_bound(x.begin(), x.end(), at) - x.begin());
  const double share = (at - x[above - 1]) / (x[above] - x[above - 1]);
  return y[above - 1] + share * (y[above] - y[above - 1]);
}

double seconds(nanoseconds time) noexcept {
  return std::chrono::duration<double>(time).count();
}

}  // namespace

double volt_at(const PiezoConfig& config, double displacement_um) noexcept {
  return between(config.curve_um, config.curve_V, displacement_um);
}

double displacement_at(const PiezoConfig& config, double volt) noexcept {
  return between(config.curve_V, config.curve_um, volt);
}

PiezoDrive::PiezoDrive(const PiezoConfig& config) : config_((config.validate(), config)) {}

void PiezoDrive::restart_at(double read_V) noexcept {
  // A voltage of a drive in use counts only if it was reached from 0 V and was not being left.
  const bool from_zero = !std::isfinite(volt_) || (known_ && obeyed_ && !zeroing_);
  known_ = zeroing_ = false;
  volt_ = asked_um_ = followed_um_ = not_a_number;
  written_since_.reset();
  obeyed_ = true;
  if (!(std::abs(read_V) > config_.tolerance_V)) return;
  known_ = from_zero;
  volt_ = std::clamp(read_V, config_.curve_V.front(), config_.curve_V.back());
  followed_um_ = displacement_at(config_, volt_);
}

void PiezoDrive::show(nanoseconds now, double read_V) noexcept {
  const bool on_its_way =
      written_since_ && seconds(now - *written_since_) < config_.settle_s + amplifier_s;
  // Before the first voltage the setpoint is 0 V.
  const double meant_V = std::isfinite(volt_) ? volt_ : 0.0;
  const bool as_meant = std::abs(read_V - meant_V) <= config_.tolerance_V;
  // An amplifier obeys again when it shows its setpoint; unless that is 0 V, it was not reached
  // from 0 V.
  const bool again = as_meant && !obeyed_ && meant_V > config_.tolerance_V;
  if ((!as_meant && !on_its_way) || again) known_ = false;
  obeyed_ = as_meant || (obeyed_ && on_its_way && std::isfinite(read_V));
  if (obeyed_ && std::isfinite(asked_um_))
    applied_um_ = asked_um_;
  else
    applied_um_ = std::abs(read_V) <= config_.tolerance_V ? 0.0 : displacement_at(config_, read_V);
}

double PiezoDrive::step(nanoseconds now, double offset_um) noexcept {
  const double before_V = volt_;
  const double volt = next(now, offset_um);
  if (std::isfinite(volt) && volt != before_V) written_since_ = now;
  return volt;
}

double PiezoDrive::next(nanoseconds now, double offset_um) noexcept {
  if (!std::isfinite(offset_um)) return volt_;
  if (!(std::abs(offset_um - asked_um_) <= still_um)) {
    asked_um_ = offset_um;
    asked_since_ = now;
  }
  if (zeroing_) {
    if (seconds(now - zero_since_) < config_.settle_s) return volt_;
    // The offset may have changed during the way to 0 V.
    zeroing_ = false;
    known_ = true;
    followed_um_ = asked_um_;
    return volt_ = volt_at(config_, asked_um_);
  }
  const bool moved = !known_ || std::abs(asked_um_ - followed_um_) >= config_.step_um;
  if (!moved || seconds(now - asked_since_) < config_.steady_s) return volt_;
  if (config_.return_to_zero) {
    zeroing_ = true;
    zero_since_ = now;
    return volt_ = 0.0;
  }
  known_ = true;
  followed_um_ = asked_um_;
  return volt_ = volt_at(config_, asked_um_);
}

}  // namespace thermocomp
