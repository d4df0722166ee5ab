#include "estimator/sensing/screening.hpp"

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
  state_.seen_at = reading.taken_at;
  state_.seen_fault = reading.fault;
  state_.verdict = judge(now, reading);
  if (state_.verdict != Fault::none) {
    if (state_.verdict != Fault::never_read) ++state_.rejected;
    return false;
  }
  state_.confirmed = is_recent(state_.good, reading) || is_recent(state_.doubted, reading);
  state_.before = state_.good;
  state_.good = {true, reading.temp_degC, reading.taken_at};
  state_.doubted = {};
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
  if (!state_.good.known && !state_.doubted.known) {
    state_.same_since = reading.taken_at;
    return Fault::none;
  }
  // A reading from before the last good one came late or doubled; it says nothing new.
  if (state_.good.known && reading.taken_at <= state_.good.at) return Fault::stale;
  if (state_.doubted.known && reading.taken_at <= state_.doubted.at) return Fault::stale;
  if (!(follows(state_.good, reading) && follows(state_.doubted, reading))) {
    if (!state_.confirmed || state_.doubted.known) doubt(reading);
    return Fault::too_fast;
  }
  if (!state_.good.known || reading.temp_degC != state_.good.temp_degC)
    state_.same_since = reading.taken_at;
  if (stuck_after_ > nanoseconds{0} && reading.taken_at - state_.same_since > stuck_after_)
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
  if (!state_.confirmed) {
    state_.good = state_.before;
    state_.before = {};
    state_.confirmed = true;
  }
  state_.doubted = {true, reading.temp_degC, reading.taken_at};
}

}  // namespace thermocomp
