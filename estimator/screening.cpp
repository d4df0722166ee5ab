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
  confirmed_ = is_recent(good_, reading) || is_recent(doubted_, reading);
  before_ = good_;
  good_ = {true, reading.temp_degC, reading.taken_at};
  doubted_ = {};
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
  if (!good_.known && !doubted_.known) {
    same_since_ = reading.taken_at;
    return Fault::none;
  }
  // A reading from before the last good one came late or doubled; it says nothing new.
  if (good_.known && reading.taken_at <= good_.at) return Fault::stale;
  if (doubted_.known && reading.taken_at <= doubted_.at) return Fault::stale;
  if (!(follows(good_, reading) && follows(doubted_, reading))) {
    if (!confirmed_ || doubted_.known) doubt(reading);
    return Fault::too_fast;
  }
  if (!good_.known || reading.temp_degC != good_.temp_degC) same_since_ = reading.taken_at;
  if (stuck_after_ > nanoseconds{0} && reading.taken_at - same_since_ > stuck_after_)
    return Fault::stuck;
  return Fault::none;
}

/// Whether the structure can have come from the value to the reading; from nothing it can. The
/// longer ago the value, the more may have changed: a true step is believed as soon as the
/// structure could have made it.
bool Screening::follows(const Value& value, const Reading& reading) const noexcept {
  if (!value.known) return true;
  const double change_K = std::abs(reading.temp_degC - value.temp_degC);
  const auto elapsed_ns = static_cast<double>((reading.taken_at - value.at).count());
  return change_K <= rate_K_per_ns_ * elapsed_ns + allowance_K_;
}

bool Screening::is_recent(const Value& value, const Reading& reading) const noexcept {
  return value.known && reading.taken_at - value.at <= stale_after_;
}

/// Of two values that contradict each other the first may be the false one.
void Screening::doubt(const Reading& reading) noexcept {
  if (!confirmed_) {
    good_ = before_;
    before_ = {};
    confirmed_ = true;
  }
  doubted_ = {true, reading.temp_degC, reading.taken_at};
}

void Screening::adopt(const Screening& previous) noexcept {
  seen_at_ = previous.seen_at_;
  seen_fault_ = previous.seen_fault_;
  verdict_ = previous.verdict_;
  good_ = previous.good_;
  before_ = previous.before_;
  doubted_ = previous.doubted_;
  confirmed_ = previous.confirmed_;
  same_since_ = previous.same_since_;
  rejected_ = previous.rejected_;
}

}  // namespace thermocomp
