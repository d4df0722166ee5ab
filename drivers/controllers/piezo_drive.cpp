#include "drivers/controllers/piezo_drive.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

namespace thermocomp {
namespace {

/// Offsets that differ by less stand still: a register's rounding, not a movement.
constexpr double still_um = 0.01;

/// y over x, straight between points; x strictly increases.
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

double PiezoDrive::step(nanoseconds now, double offset_um) noexcept {
  if (!std::isfinite(offset_um)) return volt_;
  if (!(std::abs(offset_um - asked_um_) <= still_um)) {
    asked_um_ = offset_um;
    asked_since_ = now;
  }
  if (zeroing_) {
    if (seconds(now - zero_since_) < config_.settle_s) return volt_;
    // Where it is to go by now: what has been asked for since the way down began.
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
