#include "estimator/axis_channel.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp {
namespace {

/// What a read-back may lie outside our bound because registers are rounded.
constexpr double register_rounding_um = 0.1;

/// A link reads back before it writes: the exchange under way when an axis stops being driven may
/// still write the old offset after its read-back, the one after it cannot.
constexpr std::uint8_t read_backs_until_settled = 2;

nanoseconds from_seconds(double seconds) {
  return std::chrono::duration_cast<nanoseconds>(seconds_d(seconds));
}

}  // namespace

AxisChannel::AxisChannel(const AxisConfig& config, const CompensationConfig& compensation,
                         bool reads_back)
    : limiter_(config.limiter),
      check_(compensation.mismatch_um, from_seconds(compensation.mismatch_after_s)),
      reads_back_(reads_back),
      mismatch_after_(from_seconds(compensation.mismatch_after_s)),
      prove_um_max_(compensation.prove_um_max),
      prove_hold_(from_seconds(compensation.prove_hold_s)),
      trusted_um_(config.limiter.offset_um_max) {}

void AxisChannel::step(const AxisInput& input) noexcept {
  if (input.link_epoch != epoch_) {
    epoch_ = input.link_epoch;
    synced_ = false;
    read_backs_awaited_ = 0;  // the new epoch's read-back is the first after all that was sent
  }
  if (input.online) applied_um_ = input.applied_um;
  if (!synced_)
    synchronise(input);
  else if (input.online && reads_back_)
    compare(input);
  if (!driven()) {
    prove_phase_ = ProvePhase::none;
    return;
  }
  target_um_ = input.target_um;
  if (proving()) target_um_ = prove_target_um(input.now);
  if (input.may_change) limiter_.step(target_um_, input.dt_s);
  check_.sent(input.now, limiter_.offset_um());
}

void AxisChannel::synchronise(const AxisInput& input) noexcept {
  if (!input.online || epoch_ == 0) return;
  if (!reads_back_) {
    // Nothing better is known than what was sent last.
    start_from(input.now, limiter_.offset_um());
    synced_ = true;
    return;
  }
  if (!std::isfinite(input.applied_um)) return;
  synced_ = true;
  start_from_applied(input);
}

void AxisChannel::compare(const AxisInput& input) noexcept {
  if (!std::isfinite(input.applied_um)) return;
  if (read_backs_awaited_ != 0) {
    await_read_back(input);
    return;
  }
  if (out_of_bound_) {
    // The axis is not driven until the controller itself is back within the bound.
    start_from_applied(input);
    return;
  }
  if (check_.agrees(input.applied_um)) {
    if (mismatch_ && input.now - agreed_since_ >= mismatch_after_) mismatch_ = false;
    return;
  }
  // The controller applies something else (re-homed, rejected, overridden). Going on from there is
  // the only way not to jump when it listens again - but from where it stands once all that was
  // sent has arrived: what has just been read back may be from before the last write.
  mismatch_ = true;
  agreed_since_ = input.now;
  read_backs_awaited_ = read_backs_until_settled;
  read_back_at_ = input.taken_at;
  out_of_bound_ = is_out_of_bound(input.applied_um);
}

void AxisChannel::await_read_back(const AxisInput& input) noexcept {
  agreed_since_ = input.now;
  if (input.taken_at == read_back_at_) return;
  read_back_at_ = input.taken_at;
  if (--read_backs_awaited_ == 0) start_from_applied(input);
}

bool AxisChannel::is_out_of_bound(double applied_um) const noexcept {
  return !(std::abs(applied_um) <= trusted_um_ + register_rounding_um);
}

void AxisChannel::start_from_applied(const AxisInput& input) noexcept {
  out_of_bound_ = is_out_of_bound(input.applied_um);
  if (!out_of_bound_)
    start_from(input.now, std::clamp(input.applied_um, -trusted_um_, trusted_um_));
}

void AxisChannel::start_from(nanoseconds now, double offset_um) noexcept {
  limiter_.start_from(offset_um);
  check_.restart(now, offset_um);
}

void AxisChannel::prove(double move_um) noexcept {
  // Negated so that NaN is ignored too.
  if (!driven() || !(std::abs(move_um) <= prove_um_max_)) return;
  prove_phase_ = ProvePhase::out;
  prove_from_um_ = std::clamp(limiter_.offset_um(), -limiter_.bound_um(), limiter_.bound_um());
  prove_move_um_ = move_um;
}

double AxisChannel::prove_target_um(nanoseconds now) noexcept {
  const double out_um =
      std::clamp(prove_from_um_ + prove_move_um_, -limiter_.bound_um(), limiter_.bound_um());
  if (prove_phase_ == ProvePhase::out && limiter_.offset_um() == out_um) {
    prove_phase_ = ProvePhase::wait;
    prove_until_ = now + prove_hold_;
  }
  if (prove_phase_ == ProvePhase::wait && now >= prove_until_) prove_phase_ = ProvePhase::back;
  if (prove_phase_ != ProvePhase::back) return out_um;
  if (limiter_.offset_um() == prove_from_um_) prove_phase_ = ProvePhase::none;
  return prove_from_um_;
}

void AxisChannel::restore(double offset_um) noexcept {
  // Beyond what any configuration allows it cannot be ours.
  if (!(std::abs(offset_um) <= offset_um_max_of_any_axis)) return;
  limiter_.start_from(offset_um);
  trusted_um_ = std::max(trusted_um_, std::abs(offset_um));
}

void AxisChannel::adopt(const AxisChannel& previous) noexcept {
  trusted_um_ = std::max(limiter_.bound_um(), previous.trusted_um_);
  limiter_.start_from(previous.limiter_.offset_um());
  target_um_ = previous.target_um_;
  applied_um_ = previous.applied_um_;
  epoch_ = previous.epoch_;
  synced_ = previous.synced_;
  out_of_bound_ = previous.out_of_bound_;
  mismatch_ = previous.mismatch_;
  agreed_since_ = previous.agreed_since_;
  read_backs_awaited_ = previous.read_backs_awaited_;
  read_back_at_ = previous.read_back_at_;
  check_.adopt(previous.check_);
}

}  // namespace thermocomp
