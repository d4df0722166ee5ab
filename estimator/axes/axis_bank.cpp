#include "estimator/axes/axis_bank.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "estimator/checks.hpp"

namespace thermocomp {

AxisBank::AxisBank(const EstimatorConfig& config) {
  static_assert(axes_max == 16);
  require(config.axes.size() <= axes_max, "axis", static_cast<double>(config.axes.size()),
          "must be at most 16");
  for (const AxisConfig& axis : config.axes) {
    axes_.emplace_back(axis, config.compensation, config.controller_reads_back);
    signs_.push_back(axis.sign);
  }
  spans_ = axis_spans(config.axes);
  for (const AxisSpan& span : spans_) span_of_.insert(span_of_.end(), span.count, span);
}

void AxisBank::step(const StepTime& time, const Targets& targets, bool online,
                    const ControllerState& controller, OffsetCommand& command) noexcept {
  AxisInput input;
  input.now = time.now;
  input.dt_s = time.dt_s;
  input.may_change = targets.may_change;
  input.link_epoch = controller.link_epoch;
  input.online = online;
  input.written = controller.written;
  input.taken_at = controller.taken_at;
  command.link_epoch = controller.link_epoch;
  command.read_back_number = controller.read_back_number;
  for (const AxisSpan& span : spans_) {
    for (std::size_t i = span.first; i < span.end(); ++i) {
      input.applied_um = controller.applied_um[i];
      axes_[i].observe(input);
    }
    const bool moves = driven(span);
    for (std::size_t i = span.first; i < span.end(); ++i) {
      input.target_um = targets.axis_um[i];
      if (targets.hold_where_unknown && !std::isfinite(input.target_um))
        input.target_um = axes_[i].offset_um();
      moves ? axes_[i].move(input) : axes_[i].hold(time.now);
      command.offset_um[i] = axes_[i].offset_um();
      command.valid[i] = moves;
    }
  }
}

bool AxisBank::driven(const AxisSpan& span) const noexcept {
  for (std::size_t i = span.first; i < span.end(); ++i)
    if (!axes_[i].driven()) return false;
  return true;
}

bool AxisBank::synced() const noexcept {
  bool any_known = axes_.empty();
  for (const AxisChannel& axis : axes_) {
    if (!axis.synced()) return false;
    any_known = any_known || !axis.start_unknown();
  }
  return any_known;
}

std::uint32_t AxisBank::last_offset_unknown() const noexcept {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < axes_.size(); ++i)
    if (axes_[i].last_offset_unknown()) bits |= 1u << i;
  return bits;
}

double AxisBank::compensated_um(std::size_t axis) const noexcept {
  const double applied_um = axes_[axis].applied_um();
  return signs_[axis] * (std::isfinite(applied_um) ? applied_um : axes_[axis].offset_um());
}

void AxisBank::prove(std::size_t axis, double move_um) noexcept {
  const AxisSpan span = span_of_[axis];
  if (!driven(span)) return;
  for (std::size_t i = span.first; i < span.end(); ++i) axes_[i].prove(signs_[i] * move_um);
}

void AxisBank::release(std::size_t axis) noexcept {
  const AxisSpan span = span_of_[axis];
  const std::span nodes = std::span(axes_).subspan(span.first, span.end() - span.first);
  // Ending an unknown start, the operator has set the whole axis to zero, including the nodes of a
  // travel whose offset is known.
  const bool at_zero = std::any_of(nodes.begin(), nodes.end(),
                                   [](const AxisChannel& node) { return node.start_unknown(); });
  for (AxisChannel& node : nodes) {
    if (at_zero)
      node.begin_at_zero();
    else
      node.release();
  }
}

void AxisBank::end_proves() noexcept {
  for (AxisChannel& axis : axes_) axis.end_prove();
}

void AxisBank::adopt(const AxisBank& previous, const std::vector<int>& axes) noexcept {
  for (std::size_t i = 0; i < axes.size(); ++i)
    if (axes[i] >= 0) axes_[i].adopt(previous.axes_[static_cast<std::size_t>(axes[i])]);
}

void AxisBank::visit_state(StateArchive& archive) {
  for (AxisChannel& axis : axes_) archive(axis);
}

Limiter::Limiter(const LimiterConfig& config) : config_(config) {
  config.validate();
}

void Limiter::step(double target_um, double dt_s) noexcept {
  const double wanted_um = std::isfinite(target_um) ? target_um : offset_um_;
  const double bounded_um = std::clamp(wanted_um, -bound_um(), bound_um());
  at_bound_ = bounded_um != wanted_um;
  if (!(dt_s > 0)) return;
  const double step_um_max = rate_um_per_s() * std::min(dt_s, config_.step_s_max);
  const double way_um = bounded_um - offset_um_;
  // Ends exactly on the target, so that a settled offset equals it to the last bit.
  offset_um_ = std::abs(way_um) <= step_um_max ? bounded_um
                                               : offset_um_ + std::copysign(step_um_max, way_um);
}

namespace {

/// Tolerance of a read-back outside our bound, for rounded registers.
constexpr double register_rounding_um = 0.1;

/// A second unexplained read-back within this many good ones latches the mismatch.
constexpr std::uint8_t suspicion_of_one = 16;

/// Read-backs until a command of a new epoch is surely written.
constexpr std::uint8_t read_backs_until_written = 3;

/// After a shorter absence, a read-back may still lag behind the offset sent last. From the slowest
/// read-backs tested (0.5 s) and the pauses of a reconnection.
constexpr nanoseconds lag_max = std::chrono::milliseconds(1500);

/// A controller that was ready before the start has its first link within this time.
constexpr nanoseconds first_link_max = std::chrono::seconds(3);

/// WriteGate::patience() of links with periods up to 0.6 s.
constexpr nanoseconds unwritten_max = std::chrono::seconds(3);

/// WriteGate::epoch() of the first link since the daemon's start.
constexpr std::uint32_t first_epoch = 1;

/// Tolerance between two read-backs after a release.
constexpr double same_read_back_um = 0.3;

}  // namespace

AxisChannel::AxisChannel(const AxisConfig& config, const CompensationConfig& compensation,
                         bool reads_back)
    : limiter_(config.limiter),
      check_(compensation.mismatch_um, to_nanoseconds(compensation.mismatch_after_s)),
      reads_back_(reads_back),
      mismatch_after_(to_nanoseconds(compensation.mismatch_after_s)),
      prove_um_max_(compensation.prove_um_max),
      prove_hold_(to_nanoseconds(compensation.prove_hold_s)),
      corridor_um_(compensation.restart_leap_um_max) {
  state_.trusted_um = config.limiter.offset_um_max;
}

void AxisChannel::observe(const AxisInput& input) noexcept {
  if (input.link_epoch != state_.epoch) take_epoch(input.link_epoch);
  // Before the first report the controller was away since the first step.
  if (state_.seen_at == nanoseconds{}) state_.seen_at = input.now;
  const nanoseconds seen_before = state_.seen_at;
  if (input.online) note_read_back(input);
  if (!state_.synced)
    synchronise(input, input.taken_at - seen_before);
  else if (input.online && reads_back_)
    compare(input);
}

void AxisChannel::hold(nanoseconds now) noexcept {
  end_prove();
  if (driven()) check_.sent(now, limiter_.offset_um());
}

void AxisChannel::move(const AxisInput& input) noexcept {
  state_.driven_once = true;
  state_.driven_at = input.now;
  state_.target_um = input.target_um;
  if (proving()) state_.target_um = prove_target_um(input.now);
  if (input.may_change) follow(input);
  if (in_corridor()) widen_corridor();
  check_.sent(input.now, limiter_.offset_um());
}

/// Without read-back the offset moves only while writes are confirmed, since the first offset sent
/// on a new link must be the one applied last. A controller that refuses an offset (beyond a limit
/// of its own) may accept the one in effect: the offset returns to it, no further, if the target is
/// on that side. A register value farther away than the offset has moved since the last confirmed
/// write is not ours (another axis' register).
void AxisChannel::follow(const AxisInput& input) noexcept {
  const bool is_refused = input.online && !input.written;
  const bool reaches = (input.online && input.written) || reads_back_;
  if (is_refused && can_be_ours(input.applied_um)) {
    const auto [low_um, high_um] = std::minmax({limiter_.offset_um(), input.applied_um});
    const double back_um = std::clamp(state_.target_um, low_um, high_um);
    limiter_.step(in_corridor() ? within_corridor(back_um) : back_um, input.dt_s);
  } else if (state_.read_backs_awaited == 0 && reaches) {
    limiter_.step(in_corridor() ? within_corridor(state_.target_um) : state_.target_um, input.dt_s);
  }
}

double AxisChannel::within_corridor(double target_um) noexcept {
  const double low_um = std::min({start_.saved_um, start_.low_um[0], start_.low_um[1]});
  const double high_um = std::max({start_.saved_um, start_.high_um[0], start_.high_um[1]});
  start_.held = target_um < high_um - corridor_um_ || target_um > low_um + corridor_um_;
  // NaN (stay) stays NaN.
  return std::clamp(target_um, high_um - corridor_um_, low_um + corridor_um_);
}

void AxisChannel::widen_corridor() noexcept {
  start_.low_um[0] = std::min(start_.low_um[0], limiter_.offset_um());
  start_.high_um[0] = std::max(start_.high_um[0], limiter_.offset_um());
}

/// No state with the present offset has been written to disk yet.
void AxisChannel::begin_corridor(StartEvidence by) noexcept {
  start_ = {by, false, true, not_a_number};
  start_.low_um.fill(limiter_.offset_um());
  start_.high_um.fill(limiter_.offset_um());
}

/// A pause of the same link does not change the comparison of read-backs. But the last offset may
/// not have been written (each refused write pauses the link), so the offset stays until a command
/// of the new epoch is written.
void AxisChannel::take_epoch(std::uint32_t epoch) noexcept {
  if (is_same_link(epoch, state_.epoch))
    state_.read_backs_awaited = read_backs_until_written;
  else
    state_.synced = false;
  state_.epoch = epoch;
}

void AxisChannel::note_read_back(const AxisInput& input) noexcept {
  if (reads_back_) state_.applied_um = input.applied_um;
  if (state_.read_backs_awaited > 0 && input.taken_at != state_.seen_at)
    --state_.read_backs_awaited;
  state_.seen_at = input.taken_at;
}

void AxisChannel::synchronise(const AxisInput& input, nanoseconds away) noexcept {
  if (!input.online || state_.epoch == 0) return;
  if (!reads_back_) return start_without_read_back(input, away);
  if (!std::isfinite(input.applied_um)) return;
  state_.synced = true;
  state_.starting = true;
  start_.by = StartEvidence::read_back;
  compare(input);
}

void AxisChannel::start_without_read_back(const AxisInput& input, nanoseconds away) noexcept {
  state_.synced = true;
  const double register_um = input.applied_um;
  if (!std::isfinite(register_um)) {
    if (!start_.no_registers) begin_corridor(start_.by);
    // The controller may have restarted, so the offset that it applies is unknown; likewise if it
    // could not be reached when the program began.
    if (away > (is_same_link(state_.epoch, first_epoch) ? first_link_max : lag_max))
      start_.by = StartEvidence::unknown;
    start_.unknown = start_.by == StartEvidence::unknown;
    return start_from(input.now, limiter_.offset_um());
  }
  start_.no_registers = false;
  const bool agrees =
      start_.by == StartEvidence::unknown || can_be_ours(register_um) ||
      (state_.driven_once ? check_.agrees_after_absence(register_um) : check_.agrees(register_um));
  state_.out_of_bound = is_out_of_bound(register_um);
  start_.unknown = !agrees || state_.out_of_bound;
  if (start_.unknown) return;
  start_.by = StartEvidence::registers;
  start_from(input.now, std::clamp(register_um, -state_.trusted_um, state_.trusted_um));
}

/// True if the register may hold an offset sent before: the offset may have moved on for as long as
/// a write may be unconfirmed. 0 does not count, since empty registers also hold 0.
bool AxisChannel::can_be_ours(double register_um) const noexcept {
  return std::abs(register_um) > same_read_back_um &&
         std::abs(register_um - limiter_.offset_um()) <=
             limiter_.rate_um_per_s() * to_seconds(unwritten_max);
}

void AxisChannel::compare(const AxisInput& input) noexcept {
  if (!std::isfinite(input.applied_um)) return miss_read_back(input);
  state_.out_of_bound = is_out_of_bound(input.applied_um);
  const nanoseconds before = state_.read_back_at;
  const bool fresh = input.taken_at != before;
  // A value beyond the bound on a new link was never sent, however often it is read back.
  const bool nonsense = state_.starting && !state_.latched && state_.out_of_bound;
  if (!nonsense) state_.read_back_at = input.taken_at;
  if (state_.latched) {
    state_.starting = false;  // release() decides where to start
    state_.agreed_since = input.now;
    if (state_.releasing && fresh) check_release(input);
  } else if (state_.starting) {
    // After an absence longer than the largest lag, the controller no longer shows an earlier
    // offset.
    if (input.taken_at - before > lag_max) check_.restart(input.now, limiter_.offset_um());
    start_on_link(input, fresh);
  } else if (check_.agrees(input.applied_um) && !stands_still(input.applied_um)) {
    note_explained(input, fresh);
  } else {
    note_unexplained(input, fresh);
  }
}

/// A controller that reports no number for longer than mismatch_after_s pauses the axis, since its
/// applied offset is unknown.
void AxisChannel::miss_read_back(const AxisInput& input) noexcept {
  if (state_.starting || state_.latched || input.taken_at - state_.read_back_at <= mismatch_after_)
    return;
  state_.in_doubt = true;
  state_.agreed_since = input.now;
  state_.mismatch = true;
}

/// The axis is not driven until the read-back is within the bound. After an absence the controller
/// may have lost its offset; any other unexplained value is refused. If it shows an offset sent
/// lately, it has kept it and reports late: the offset continues from the value sent.
void AxisChannel::start_on_link(const AxisInput& input, bool fresh) noexcept {
  if (state_.out_of_bound) return;
  if (state_.driven_once && !check_.agrees_after_absence(input.applied_um))
    return note_unexplained(input, fresh);
  state_.starting = false;
  state_.in_doubt = false;
  const bool at_nothing = std::abs(input.applied_um) <= same_read_back_um;
  if (state_.driven_once && !at_nothing && check_.agrees(input.applied_um)) {
    state_.read_backs_awaited = is_applied(input) ? 0 : read_backs_until_written;
    return;
  }
  state_.unwritten_for = read_backs_until_written;
  // A zero offset that reads back as zero shows that no constant is added.
  if (!state_.driven_once && std::abs(input.applied_um) <= same_read_back_um)
    state_.pairs.note(0.0, input.applied_um);
  start_from(input.now, std::clamp(input.applied_um, -state_.trusted_um, state_.trusted_um));
}

/// True if the read-back stayed the same while an offset far from all those sent lately was sent:
/// no delay within mismatch_after_s explains that.
bool AxisChannel::stands_still(double applied_um) const noexcept {
  const ConstantReadBack found = state_.pairs.standing(limiter_.offset_um(), applied_um);
  return check_.is_far(found.low_um) || check_.is_far(found.high_um);
}

void AxisChannel::note_explained(const AxisInput& input, bool fresh) noexcept {
  state_.in_doubt = false;
  if (state_.mismatch && input.now - state_.agreed_since >= mismatch_after_)
    state_.mismatch = false;
  if (!fresh) return;
  if (state_.suspicion > 0) --state_.suspicion;
  // Before the first command is written, the read-back is not our offset.
  if (state_.unwritten_for > 0)
    --state_.unwritten_for;
  else if (state_.driven_once)
    state_.pairs.note(limiter_.offset_um(), input.applied_um);
}

void AxisChannel::note_unexplained(const AxisInput& input, bool fresh) noexcept {
  state_.mismatch = true;
  state_.agreed_since = input.now;
  const bool counts = fresh || !state_.in_doubt;
  state_.in_doubt = true;
  if (!counts) return;
  if (state_.suspicion == 0) {
    state_.suspicion = suspicion_of_one;
    return;
  }
  state_.latched = true;
  state_.releasing = false;
  state_.starting = false;
  // After a pause, offsets newer than the last explained read-back have not been written.
  const double sent_um = state_.read_backs_awaited > 0
                             ? state_.pairs.last_sent_um(limiter_.offset_um())
                             : limiter_.offset_um();
  state_.latched_mismatch = state_.pairs.judge(sent_um, input.applied_um);
  state_.pairs.note(sent_um, input.applied_um);
}

void AxisChannel::begin_at_zero() noexcept {
  const bool no_registers = start_.no_registers;
  start_from(state_.seen_at, 0.0);
  begin_corridor(StartEvidence::released);
  start_.no_registers = no_registers;
  state_.out_of_bound = false;
}

void AxisChannel::release() noexcept {
  if (start_unknown()) return begin_at_zero();
  // A repeated release must not restart the wait for read-backs: on a slow link it would never end.
  if (!state_.latched || state_.releasing) return;
  state_.releasing = true;
  state_.released_um = not_a_number;
}

void AxisChannel::saved(double offset_um) noexcept {
  if (!(std::abs(offset_um - limiter_.offset_um()) <= corridor_um_)) return;
  start_.saved_um = offset_um;
  start_.low_um = {limiter_.offset_um(), start_.low_um[0]};
  start_.high_um = {limiter_.offset_um(), start_.high_um[0]};
}

void AxisChannel::check_release(const AxisInput& input) noexcept {
  const double sent_um = limiter_.offset_um();
  const bool mended = std::abs(input.applied_um - sent_um) <= same_read_back_um;
  const bool first = std::isnan(state_.released_um);
  const bool is_at_released = std::abs(input.applied_um - state_.released_um) <= same_read_back_um;
  if (state_.out_of_bound || !(first || is_at_released) ||
      (!mended && state_.latched_mismatch.explains(sent_um, input.applied_um))) {
    state_.releasing = false;
    return;
  }
  state_.released_um = input.applied_um;
  const double could_go_um = limiter_.rate_um_per_s() * to_seconds(input.now - state_.driven_at);
  if (first || std::abs(input.applied_um - sent_um) > could_go_um) return;
  end_latch();
  state_.pairs.note(input.applied_um, not_a_number);
  state_.unwritten_for = read_backs_until_written;
  start_from(input.now, std::clamp(input.applied_um, -state_.trusted_um, state_.trusted_um));
}

void AxisChannel::end_latch() noexcept {
  state_.latched = false;
  state_.releasing = false;
  state_.in_doubt = false;
  state_.suspicion = 0;
}

/// True if the last offset is written and no other is under way.
bool AxisChannel::is_applied(const AxisInput& input) const noexcept {
  return std::abs(input.applied_um - limiter_.offset_um()) <= register_rounding_um;
}

bool AxisChannel::is_out_of_bound(double applied_um) const noexcept {
  return !(std::abs(applied_um) <= state_.trusted_um + register_rounding_um);
}

void AxisChannel::start_from(nanoseconds now, double offset_um) noexcept {
  limiter_.start_from(offset_um);
  check_.restart(now, offset_um);
}

void AxisChannel::prove(double move_um) noexcept {
  // Negated so that NaN is ignored too.
  if (!driven() || !(std::abs(move_um) <= prove_um_max_)) return;
  state_.prove.phase = ProvePhase::out;
  state_.prove.from_um =
      std::clamp(limiter_.offset_um(), -limiter_.bound_um(), limiter_.bound_um());
  state_.prove.move_um = move_um;
}

double AxisChannel::prove_target_um(nanoseconds now) noexcept {
  const double out_um = std::clamp(state_.prove.from_um + state_.prove.move_um,
                                   -limiter_.bound_um(), limiter_.bound_um());
  if (state_.prove.phase == ProvePhase::out && limiter_.offset_um() == out_um) {
    state_.prove.phase = ProvePhase::wait;
    state_.prove.until = now + prove_hold_;
  }
  if (state_.prove.phase == ProvePhase::wait && now >= state_.prove.until)
    state_.prove.phase = ProvePhase::back;
  if (state_.prove.phase != ProvePhase::back) return out_um;
  if (limiter_.offset_um() == state_.prove.from_um) state_.prove.phase = ProvePhase::none;
  return state_.prove.from_um;
}

void AxisChannel::restore(const SentBefore& before) noexcept {
  const auto is_possible = [this](double um) { return std::abs(um) <= limiter_.bound_um(); };
  const bool is_corridor = before.is_corridor && is_possible(before.saved_um);
  StartEvidence by = StartEvidence::unknown;
  if (is_possible(before.recorded_um)) {
    by = StartEvidence::record;
    start_from({}, before.recorded_um);
  } else if (is_possible(before.saved_um)) {
    if (is_corridor) by = StartEvidence::corridor;
    start_from({}, before.saved_um);
  }
  if (reads_back_) return;
  if (is_corridor) begin_corridor(by);
  start_.by = by;
  if (is_corridor) start_.saved_um = before.saved_um;
}

void AxisChannel::adopt(const AxisChannel& previous) noexcept {
  limiter_.start_from(previous.limiter_.offset_um());
  check_.adopt(previous.check_);
  state_ = previous.state_;
  state_.trusted_um = std::max(limiter_.bound_um(), previous.state_.trusted_um);
  start_ = previous.start_;
  state_.prove = {};  // a proving move under another configuration is not continued
}

AppliedCheck::AppliedCheck(double tolerance_um, nanoseconds window)
    : tolerance_um_(tolerance_um),
      slot_length_(std::max(nanoseconds{1}, window / static_cast<int>(slots - 1))) {}

void AppliedCheck::restart(nanoseconds now, double offset_um) noexcept {
  state_.min_um.fill(offset_um);
  state_.max_um.fill(offset_um);
  state_.slot_until = now + slot_length_;
}

void AppliedCheck::sent(nanoseconds now, double offset_um) noexcept {
  if (now >= state_.slot_until) {
    state_.newest = (state_.newest + 1) % slots;
    state_.slot_until = now + slot_length_;
    state_.min_um[state_.newest] = offset_um;
    state_.max_um[state_.newest] = offset_um;
  }
  state_.min_um[state_.newest] = std::min(state_.min_um[state_.newest], offset_um);
  state_.max_um[state_.newest] = std::max(state_.max_um[state_.newest], offset_um);
}

double AppliedCheck::lowest_um() const noexcept {
  return *std::min_element(state_.min_um.begin(), state_.min_um.end());
}

double AppliedCheck::highest_um() const noexcept {
  return *std::max_element(state_.max_um.begin(), state_.max_um.end());
}

bool AppliedCheck::is_between(double applied_um, double low_um, double high_um) const noexcept {
  return applied_um >= low_um - tolerance_um_ && applied_um <= high_um + tolerance_um_;
}

bool AppliedCheck::agrees(double applied_um) const noexcept {
  return is_between(applied_um, lowest_um(), highest_um());
}

bool AppliedCheck::is_far(double offset_um) const noexcept {
  return !is_between(offset_um, lowest_um() - tolerance_um_ / 2, highest_um() + tolerance_um_ / 2);
}

bool AppliedCheck::agrees_after_absence(double applied_um) const noexcept {
  return is_between(applied_um, std::min(0.0, lowest_um()), std::max(0.0, highest_um()));
}

}  // namespace thermocomp
