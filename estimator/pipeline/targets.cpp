#include "estimator/pipeline/targets.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {

ModeDecision::ModeDecision(const CompensationConfig& config)
    : ramps_on_loss_(config.on_loss == LossPolicy::ramp_to_zero),
      hold_(to_nanoseconds(config.hold_s)) {
  state_.enabled = config.enabled_at_first_start;
}

Mode ModeDecision::step(const ModeInput& input) noexcept {
  if (input.time.first) state_.lost_since = input.time.now;
  const bool works_if_written =
      input.displacement_known && input.controller_online && input.axes_synced;
  const bool works = works_if_written && input.controller_written;
  only_unwritten_ = works_if_written && !works;
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
  const bool given_up = !works && ramps_on_loss_ && input.time.now - state_.lost_since > hold_;
  if (state_.stopping || given_up) return Mode::ramping_to_zero;
  if (works) return Mode::compensating;
  return state_.ever_worked ? Mode::holding : Mode::starting;
}

namespace {

bool is_finite(double value) noexcept {
  return std::isfinite(value);
}

}  // namespace

CycleHold::CycleHold(const ThermalModel& model, double ahead) : ahead_(ahead), model_(model) {
  for (const std::string& name : model.signal_columns())
    is_position_.push_back(name.ends_with("_mm"));
  state_.held_degC.assign(model.temperature_columns().size(), not_a_number);
  state_.ended_degC = state_.held_degC;
  state_.held_signals.assign(is_position_.size(), not_a_number);
}

void CycleHold::cycle_end(nanoseconds now, std::span<const double> temps_degC,
                          std::span<const double> signals, const DisplacementModel& live) noexcept {
  THERMOCOMP_ENSURE(temps_degC.size() == state_.held_degC.size());
  const double ahead = state_.ended ? ahead_ : 0.0;
  for (std::size_t i = 0; i < state_.held_degC.size(); ++i) {
    const double change_K = state_.ended ? temps_degC[i] - state_.ended_degC[i] : 0.0;
    state_.held_degC[i] = temps_degC[i] + ahead * change_K;
    state_.ended_degC[i] = temps_degC[i];
  }
  const double interval_ns =
      state_.ended ? static_cast<double>((now - state_.ended_at).count()) : 0.0;
  state_.at = now + nanoseconds(std::llround(ahead * interval_ns));
  state_.ended = true;
  state_.ended_at = now;
  model_.copy_states(live);
  hold(signals);
}

void CycleHold::restart(nanoseconds now, std::span<const double> temps_degC,
                        std::span<const double> signals) noexcept {
  THERMOCOMP_ENSURE(temps_degC.size() == state_.held_degC.size());
  std::copy(temps_degC.begin(), temps_degC.end(), state_.held_degC.begin());
  state_.at = now;
  state_.ended = false;
  model_.restart();
  hold(signals);
}

void CycleHold::displacement(std::span<const double> reference_degC,
                             std::span<const double> signals,
                             std::span<double> displacement_um) noexcept {
  THERMOCOMP_ENSURE(state_.holds && signals.size() == state_.held_signals.size());
  for (std::size_t i = 0; i < signals.size(); ++i)
    if (is_position_[i]) state_.held_signals[i] = signals[i];
  model_.step(state_.at, state_.held_degC, reference_degC, state_.held_signals, displacement_um);
}

void CycleHold::restore(std::span<const double> temps_degC,
                        std::span<const double> signals) noexcept {
  THERMOCOMP_ENSURE(temps_degC.size() == state_.held_degC.size());
  std::copy(temps_degC.begin(), temps_degC.end(), state_.held_degC.begin());
  hold(signals);
}

void CycleHold::adopt(const CycleHold& previous, const std::vector<int>& columns,
                      const std::vector<int>& signals, const std::vector<int>& terms) noexcept {
  take_by_plan(columns, previous.state_.held_degC, state_.held_degC);
  take_by_plan(columns, previous.state_.ended_degC, state_.ended_degC);
  take_by_plan(signals, previous.state_.held_signals, state_.held_signals);
  model_.adopt_terms(previous.model_, terms);
  state_.at = previous.state_.at;
  state_.ended_at = previous.state_.ended_at;
  state_.ended = previous.state_.ended &&
                 std::all_of(state_.ended_degC.begin(), state_.ended_degC.end(), is_finite);
  hold(state_.held_signals);
  state_.holds = state_.holds && previous.state_.holds;
}

/// Holds `signals` from here on; a state with an unknown value is not held.
void CycleHold::hold(std::span<const double> signals) noexcept {
  THERMOCOMP_ENSURE(signals.size() == state_.held_signals.size());
  state_.holds = std::all_of(state_.held_degC.begin(), state_.held_degC.end(), is_finite);
  for (std::size_t i = 0; i < signals.size(); ++i) {
    state_.held_signals[i] = signals[i];
    if (!is_position_[i] && !std::isfinite(signals[i])) state_.holds = false;
  }
}

CycleUpdate::CycleUpdate(const EstimatorConfig& config, const ThermalModel& model,
                         const std::vector<std::size_t>& axis_output)
    : each_cycle_(config.compensation.update == UpdateRule::each_cycle),
      signal_name_(config.compensation.cycle_end_signal),
      axis_output_(axis_output),
      hold_(model, config.compensation.cycle_ahead),
      ends_(config.compensation.cycles_per_update, signal_name_.ends_with("_on")),
      curves_(config, model),
      places_(node_places(config, model)),
      held_um_(model.outputs.size(), not_a_number),
      node_um_(axis_output.size(), not_a_number),
      rise_K_(model.temperature_columns().size(), 0.0) {
  state_.axis_um.assign(axis_output.size(), not_a_number);
}

std::span<const double> CycleUpdate::step(nanoseconds now, const Displacement& displacement,
                                          bool compensating, const Temperatures& temps,
                                          const ReferenceState& reference, const Signals& signals,
                                          const DisplacementModel& live,
                                          const Probings& learned) noexcept {
  if (signals.online) ends_.signal(signals.cycle_end);
  if (!each_cycle_) return displacement.axis_um;
  if (ends_.take(displacement.known && compensating && !displacement.held)) {
    hold_.cycle_end(now, temps.estimated_degC, signals.of_model, live);
    state_.share = displacement.used_share;
  }
  if (displacement.known && hold_.holds()) evaluate(displacement, reference, signals, learned);
  return state_.axis_um;
}

void CycleUpdate::evaluate(const Displacement& displacement, const ReferenceState& reference,
                           const Signals& signals, const Probings& learned) noexcept {
  const auto displacement_at = [&](std::span<const double> at, std::span<double> out_um) {
    hold_.displacement(reference.temps_degC, at, out_um);
  };
  curves_.step(displacement_at, signals.of_model, node_um_);
  displacement_at(signals.of_model, held_um_);
  for (std::size_t i = 0; i < rise_K_.size(); ++i)
    rise_K_[i] = hold_.temps_degC()[i] - reference.temps_degC[i];
  // Held like the temperatures; unknown after a restart.
  const double share = std::isfinite(state_.share) ? state_.share : displacement.used_share;
  for (std::size_t i = 0; i < axis_output_.size(); ++i)
    state_.axis_um[i] = share * ((places_[i].is_node ? node_um_[i] : held_um_[axis_output_[i]]) -
                                 displacement.zero_um[axis_output_[i]]) +
                        learned.correction_um(i, rise_K_);
}

void CycleUpdate::restart(nanoseconds now, std::span<const double> temps_degC,
                          std::span<const double> signals) noexcept {
  if (hold_.holds()) hold_.restart(now, temps_degC, signals);
}

void CycleUpdate::adopt(const CycleUpdate& previous, const std::vector<int>& columns,
                        const std::vector<int>& signals, const std::vector<int>& axes,
                        const std::vector<int>& terms) noexcept {
  state_.share = previous.state_.share;
  take_by_plan(axes, previous.state_.axis_um, state_.axis_um);
  hold_.adopt(previous.hold_, columns, signals, terms);
  ends_.adopt(previous.ends_, signal_name_ == previous.signal_name_);
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
