#include "estimator/learning/cycle_update.hpp"

#include <cmath>

#include "estimator/name_index.hpp"

namespace thermocomp {

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
    state_.share = displacement.believed_share;
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
  // Held like the temperatures; after a restart it is not known any more.
  const double share = std::isfinite(state_.share) ? state_.share : displacement.believed_share;
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

}  // namespace thermocomp
