#include "estimator/screening.hpp"

#include <cmath>

namespace thermocomp {

Screening::Screening(const ScreeningConfig& config)
    : min_degC_(config.temp_degC_min),
      max_degC_(config.temp_degC_max),
      rate_K_per_ns_(config.rate_K_per_s_max * 1e-9),
      allowance_K_(config.rate_allowance_K),
      stale_after_(std::chrono::duration_cast<nanoseconds>(seconds_d(config.stale_after_s))),
      stuck_after_(std::chrono::duration_cast<nanoseconds>(seconds_d(config.stuck_after_s))) {
  config.validate();
}

bool Screening::take(nanoseconds now, const Reading& reading) noexcept {
  seen_at_ = reading.taken_at;
  seen_fault_ = reading.fault;
  verdict_ = judge(now, reading);
  if (verdict_ != Fault::none) {
    if (verdict_ != Fault::never_read) ++rejected_;
    return false;
  }
  confirmed_ = has_good_;
  good_degC_ = reading.temp_degC;
  good_at_ = reading.taken_at;
  has_good_ = true;
  return true;
}

Fault Screening::judge(nanoseconds now, const Reading& reading) noexcept {
  if (reading.fault != Fault::none) return reading.fault;
  // Written so that NaN fails.
  if (!(reading.temp_degC >= min_degC_ && reading.temp_degC <= max_degC_))
    return Fault::out_of_range;
  // A time far ahead is as useless as an old one: it would make every later reading look old.
  if (!(reading.taken_at >= now - stale_after_ && reading.taken_at <= now + stale_after_))
    return Fault::stale;
  if (!has_good_) {
    same_since_ = reading.taken_at;
    return Fault::none;
  }
  // A reading from before the last good one came late or doubled; it says nothing new.
  if (reading.taken_at <= good_at_) return Fault::stale;
  const double change_K = std::abs(reading.temp_degC - good_degC_);
  // The longer ago the last good reading, the more may have changed: a true step is believed
  // as soon as the structure could have made it.
  const auto elapsed_ns = static_cast<double>((reading.taken_at - good_at_).count());
  if (!(change_K <= rate_K_per_ns_ * elapsed_ns + allowance_K_)) {
    // Of two values that contradict each other the first may be the false one: while no second one
    // has agreed with it, neither is believed.
    if (!confirmed_) has_good_ = false;
    return Fault::too_fast;
  }
  if (change_K > 0) same_since_ = reading.taken_at;
  if (stuck_after_ > nanoseconds{0} && reading.taken_at - same_since_ > stuck_after_)
    return Fault::stuck;
  return Fault::none;
}

void Screening::adopt(const Screening& previous) noexcept {
  seen_at_ = previous.seen_at_;
  seen_fault_ = previous.seen_fault_;
  verdict_ = previous.verdict_;
  has_good_ = previous.has_good_;
  confirmed_ = previous.confirmed_;
  good_degC_ = previous.good_degC_;
  good_at_ = previous.good_at_;
  same_since_ = previous.same_since_;
  rejected_ = previous.rejected_;
}

}  // namespace thermocomp
