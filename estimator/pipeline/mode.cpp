#include "estimator/pipeline/mode.hpp"

#include <chrono>

namespace thermocomp {

std::string_view to_string(Mode mode) noexcept {
  switch (mode) {
    case Mode::starting:
      return "starting";
    case Mode::disabled:
      return "disabled";
    case Mode::compensating:
      return "compensating";
    case Mode::holding:
      return "holding";
    case Mode::ramping_to_zero:
      return "ramping_to_zero";
  }
  return "unknown";
}

std::string_view to_string(Reason reason) noexcept {
  switch (reason) {
    case Reason::operator_disabled:
      return "operator_disabled";
    case Reason::controller_disabled:
      return "controller_disabled";
    case Reason::block_lost:
      return "block_lost";
    case Reason::signal_lost:
      return "signal_lost";
    case Reason::no_reference:
      return "no_reference";
    case Reason::controller_offline:
      return "controller_offline";
    case Reason::not_synced:
      return "not_synced";
    case Reason::mismatch:
      return "mismatch";
    case Reason::cutting:
      return "cutting";
    case Reason::at_bound:
      return "at_bound";
    case Reason::applied_out_of_bound:
      return "applied_out_of_bound";
    case Reason::block_estimated:
      return "block_estimated";
    case Reason::mismatch_latched:
      return "mismatch_latched";
    case Reason::no_target:
      return "no_target";
    case Reason::outside_domain:
      return "outside_domain";
    case Reason::sensor_suspected:
      return "sensor_suspected";
    case Reason::not_written:
      return "not_written";
    case Reason::sensor_unconfirmed:
      return "sensor_unconfirmed";
    case Reason::start_unknown:
      return "start_unknown";
  }
  return "unknown";
}

ModeDecision::ModeDecision(const CompensationConfig& config)
    : gives_up_(config.on_loss == LossPolicy::ramp_to_zero), hold_(to_nanoseconds(config.hold_s)) {
  state_.enabled = config.enabled_at_first_start;
}

Mode ModeDecision::step(const ModeInput& input) noexcept {
  if (input.time.first) state_.lost_since = input.time.now;
  const bool works = input.displacement_known && input.controller_online && input.axes_synced &&
                     input.controller_written;
  if (works) {
    state_.ever_worked = true;
    state_.lost_since = input.time.now;
  }
  const Mode next = decide(input, works);
  if (next != state_.mode) {
    state_.mode = next;
    state_.mode_since = input.time.now;
  }
  return next;
}

Mode ModeDecision::decide(const ModeInput& input, bool works) const noexcept {
  if (!state_.enabled || input.controller_disables) return Mode::disabled;
  const bool given_up = !works && gives_up_ && input.time.now - state_.lost_since > hold_;
  if (state_.stopping || given_up) return Mode::ramping_to_zero;
  if (works) return Mode::compensating;
  return state_.ever_worked ? Mode::holding : Mode::starting;
}

TargetRule::TargetRule(const EstimatorConfig& config)
    : hold_while_cutting_(config.compensation.hold_while_cutting),
      targets_um_(config.axes.size(), not_a_number) {
  for (const AxisConfig& axis : config.axes) signs_.push_back(axis.sign);
}

Targets TargetRule::step(Mode mode, std::span<const double> axis_um,
                         const Displacement& displacement, const Signals& signals) noexcept {
  Targets targets{targets_um_};
  // Only a definite "not cutting" lets the offset change.
  targets.may_change = !hold_while_cutting_ || signals.surely_not_cutting();
  targets.waits_for_cut = mode == Mode::ramping_to_zero && signals.may_be_cutting();
  // Before the first cycle end there is no target: an axis keeps its offset.
  targets.hold_where_unknown = mode == Mode::compensating;
  const bool to_zero =
      mode == Mode::disabled || (mode == Mode::ramping_to_zero && !targets.waits_for_cut);
  const bool follows = mode == Mode::compensating && !displacement.held;
  for (std::size_t i = 0; i < targets_um_.size(); ++i)
    targets_um_[i] = follows ? -signs_[i] * axis_um[i] : to_zero ? 0.0 : not_a_number;
  return targets;
}

}  // namespace thermocomp
