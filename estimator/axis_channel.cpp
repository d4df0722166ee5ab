#include "estimator/axis_channel.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp {
namespace {

/// What a read-back may lie outside our bound because registers are rounded.
constexpr double register_rounding_um = 0.1;

/// One unexplained read-back outweighs so many good ones; a second one within them latches.
constexpr std::uint8_t suspicion_of_one = 16;

/// The one that comes with a new epoch, the one before its first command is written, and the one
/// that shows that it was.
constexpr std::uint8_t read_backs_until_written = 3;

/// What is read back on a link that was away for less may be a value on the way to the one sent
/// last; set from the slowest read-backs that were tried (0.5 s) and the pauses of a reconnection.
constexpr nanoseconds lag_max = std::chrono::milliseconds(1500);

/// Two read-backs after a release that are no further apart say the same.
constexpr double same_read_back_um = 0.3;

nanoseconds from_seconds(double seconds) {
  return std::chrono::duration_cast<nanoseconds>(seconds_d(seconds));
}
double to_seconds(nanoseconds time) {
  return 1e-9 * static_cast<double>(time.count());
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
  if (input.link_epoch != epoch_) take_epoch(input.link_epoch);
  if (input.online) note_read_back(input);
  if (!synced_)
    synchronise(input);
  else if (input.online && reads_back_)
    compare(input);
  if (!driven()) {
    prove_phase_ = ProvePhase::none;
    return;
  }
  driven_once_ = true;
  driven_at_ = input.now;
  target_um_ = input.target_um;
  if (proving()) target_um_ = prove_target_um(input.now);
  if (input.may_change && stands_for_ == 0) limiter_.step(target_um_, input.dt_s);
  check_.sent(input.now, limiter_.offset_um());
}

/// A pause of the same link changes nothing by itself: what is read back is compared as ever. But
/// what was sent last may not have been written (a controller that refuses it pauses the link each
/// time), so the offset does not go on before a command of the new epoch has been.
void AxisChannel::take_epoch(std::uint32_t epoch) noexcept {
  if (is_same_link(epoch, epoch_))
    stands_for_ = read_backs_until_written;
  else
    synced_ = false;
  epoch_ = epoch;
}

void AxisChannel::note_read_back(const AxisInput& input) noexcept {
  applied_um_ = input.applied_um;
  if (stands_for_ > 0 && input.taken_at != seen_at_) --stands_for_;
  seen_at_ = input.taken_at;
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
  // Away for longer than a controller may lag, it shows none of the values on the way any more.
  if (input.taken_at - read_back_at_ > lag_max) check_.restart(input.now, limiter_.offset_um());
  synced_ = true;
  starting_ = true;
  compare(input);
}

void AxisChannel::compare(const AxisInput& input) noexcept {
  if (!std::isfinite(input.applied_um)) return;
  const bool fresh = input.taken_at != read_back_at_;
  read_back_at_ = input.taken_at;
  out_of_bound_ = is_out_of_bound(input.applied_um);
  if (latched_) {
    starting_ = false;  // a release decides where to start
    agreed_since_ = input.now;
    if (releasing_ && fresh) check_release(input);
  } else if (starting_) {
    start_on_link(input, fresh);
  } else if (check_.agrees(input.applied_um)) {
    note_explained(input, fresh);
  } else {
    note_unexplained(input, fresh);
  }
}

/// The axis is not driven until the controller itself is within the bound. A controller that was
/// away may have lost its offset; one that comes back with another is not believed. One that shows
/// what was sent lately has it still, and only tells it late: the value sent stays the axis' own.
void AxisChannel::start_on_link(const AxisInput& input, bool fresh) noexcept {
  if (out_of_bound_) return;
  if (driven_once_ && !check_.agrees_after_absence(input.applied_um))
    return note_unexplained(input, fresh);
  starting_ = false;
  in_doubt_ = false;
  const bool at_nothing = std::abs(input.applied_um) <= same_read_back_um;
  if (driven_once_ && !at_nothing && check_.agrees(input.applied_um)) {
    stands_for_ = is_applied(input) ? 0 : read_backs_until_written;
    return;
  }
  unwritten_for_ = read_backs_until_written;
  // Nothing sent and nothing read: nothing is added there.
  if (!driven_once_ && std::abs(input.applied_um) <= same_read_back_um)
    pairs_.note(0.0, input.applied_um);
  start_from(input.now, std::clamp(input.applied_um, -trusted_um_, trusted_um_));
}

void AxisChannel::note_explained(const AxisInput& input, bool fresh) noexcept {
  in_doubt_ = false;
  if (mismatch_ && input.now - agreed_since_ >= mismatch_after_) mismatch_ = false;
  if (!fresh) return;
  if (suspicion_ > 0) --suspicion_;
  // Until the first command has been written it is not ours that is read back.
  if (unwritten_for_ > 0)
    --unwritten_for_;
  else if (driven_once_)
    pairs_.note(limiter_.offset_um(), input.applied_um);
}

void AxisChannel::note_unexplained(const AxisInput& input, bool fresh) noexcept {
  mismatch_ = true;
  agreed_since_ = input.now;
  const bool counts = fresh || !in_doubt_;
  in_doubt_ = true;
  if (!counts) return;
  if (suspicion_ == 0) {
    suspicion_ = suspicion_of_one;
    return;
  }
  latched_ = true;
  releasing_ = false;
  starting_ = false;
  latched_mismatch_ = pairs_.judge(limiter_.offset_um(), input.applied_um);
  pairs_.note(limiter_.offset_um(), input.applied_um);
}

void AxisChannel::release() noexcept {
  // Said again while read-backs are awaited it must not make them begin anew: with a slow link and
  // an impatient operator they would never be enough.
  if (!latched_ || releasing_) return;
  releasing_ = true;
  released_um_ = not_a_number;
}

void AxisChannel::check_release(const AxisInput& input) noexcept {
  const double sent_um = limiter_.offset_um();
  const bool mended = std::abs(input.applied_um - sent_um) <= same_read_back_um;
  const bool first = std::isnan(released_um_);
  const bool stands = std::abs(input.applied_um - released_um_) <= same_read_back_um;
  if (out_of_bound_ || !(first || stands) ||
      (!mended && latched_mismatch_.explains(sent_um, input.applied_um))) {
    releasing_ = false;
    return;
  }
  released_um_ = input.applied_um;
  const double could_go_um = limiter_.rate_um_per_s() * to_seconds(input.now - driven_at_);
  if (first || std::abs(input.applied_um - sent_um) > could_go_um) return;
  end_latch();
  start_from(input.now, std::clamp(input.applied_um, -trusted_um_, trusted_um_));
}

void AxisChannel::end_latch() noexcept {
  latched_ = false;
  releasing_ = false;
  in_doubt_ = false;
  suspicion_ = 0;
}

/// What was sent last has been written, and nothing is on its way.
bool AxisChannel::is_applied(const AxisInput& input) const noexcept {
  return std::abs(input.applied_um - limiter_.offset_um()) <= register_rounding_um;
}

bool AxisChannel::is_out_of_bound(double applied_um) const noexcept {
  return !(std::abs(applied_um) <= trusted_um_ + register_rounding_um);
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
  starting_ = previous.starting_;
  driven_once_ = previous.driven_once_;
  out_of_bound_ = previous.out_of_bound_;
  mismatch_ = previous.mismatch_;
  agreed_since_ = previous.agreed_since_;
  in_doubt_ = previous.in_doubt_;
  suspicion_ = previous.suspicion_;
  latched_ = previous.latched_;
  releasing_ = previous.releasing_;
  released_um_ = previous.released_um_;
  latched_mismatch_ = previous.latched_mismatch_;
  pairs_ = previous.pairs_;
  read_back_at_ = previous.read_back_at_;
  stands_for_ = previous.stands_for_;
  unwritten_for_ = previous.unwritten_for_;
  seen_at_ = previous.seen_at_;
  driven_at_ = previous.driven_at_;
  check_.adopt(previous.check_);
}

}  // namespace thermocomp
