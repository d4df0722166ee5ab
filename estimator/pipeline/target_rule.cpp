#include "estimator/pipeline/target_rule.hpp"

namespace thermocomp {

TargetRule::TargetRule(const EstimatorConfig& config)
    : hold_while_cutting_(config.compensation.hold_while_cutting),
      targets_um_(config.axes.size(), not_a_number) {
  for (const AxisConfig& axis : config.axes) signs_.push_back(axis.sign);
}

Targets TargetRule::step(Mode mode, std::span<const double> axis_um,
                         const Displacement& displacement, const Signals& signals) noexcept {
  Targets targets{targets_um_};
  // Only a clear "not cutting" lets the offset change.
  targets.may_change = !hold_while_cutting_ || signals.surely_not_cutting();
  targets.waits_for_cut = mode == Mode::ramping_to_zero && signals.may_be_cutting();
  // Before the first cycle end there is nothing to go to: where it stands is the target.
  targets.stand_where_unknown = mode == Mode::compensating;
  const bool to_zero =
      mode == Mode::disabled || (mode == Mode::ramping_to_zero && !targets.waits_for_cut);
  const bool follows = mode == Mode::compensating && !displacement.held;
  for (std::size_t i = 0; i < targets_um_.size(); ++i)
    targets_um_[i] = follows ? -signs_[i] * axis_um[i] : to_zero ? 0.0 : not_a_number;
  return targets;
}

}  // namespace thermocomp
