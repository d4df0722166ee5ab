#include "estimator/pipeline/prediction.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp {

Prediction::Prediction(const EstimatorConfig& config, const ThermalModel& model,
                       const std::vector<std::size_t>& axis_output)
    : policy_(config.compensation.outside_domain),
      axis_output_(axis_output),
      places_(node_places(config, model)),
      model_(model),
      at_reference_(model),
      certainty_(config, model, axis_output),
      axis_um_(axis_output.size(), not_a_number),
      curves_(config, model),
      node_um_(axis_output.size(), not_a_number) {
  if (!curves_.empty()) elsewhere_.emplace(model);
  if (model.made_from) domain_.emplace(model);
  state_.model_um.assign(model.outputs.size(), not_a_number);
  state_.zero_um.assign(model.outputs.size(), not_a_number);
}

Displacement Prediction::step(nanoseconds now, const Temperatures& temps,
                              const ReferenceState& reference, const Signals& signals,
                              const LostBlocks& lost, Probings& learned) noexcept {
  if (reference.changed) state_.zero_known = false;
  const bool certain = certainty_.step(lost, model_, reference, signals);
  Displacement found;
  found.block_lost = !temps.all_good && !certain;
  found.block_estimated = !temps.all_good && certain;
  if (!found.block_lost && signals.complete && reference.known) {
    predict(now, temps, reference, signals);
    learned.step(now, temps, reference, !signals.may_be_cutting());
    for (std::size_t i = 0; i < axis_um_.size(); ++i) axis_um_[i] = axis_um(i, learned);
    // Inputs that are good and a model that is may still give no number together.
    found.known = std::all_of(axis_um_.begin(), axis_um_.end(),
                              [](double value_um) { return std::isfinite(value_um); });
    found.not_finite = !found.known;
  }
  found.outside = outside();
  found.held = policy_ == OutsidePolicy::hold && found.outside;
  if (domain_ && found.known) outside_share_.step(now, found.outside);
  found.believed_share = believed_share();
  found.zero_um = state_.zero_um;
  found.axis_um = axis_um_;
  return found;
}

void Prediction::predict(nanoseconds now, const Temperatures& temps,
                         const ReferenceState& reference, const Signals& signals) noexcept {
  if (!state_.zero_known) {
    at_reference_.restart();
    at_reference_.step(now, reference.temps_degC, reference.temps_degC, reference.signals,
                       state_.zero_um);
    state_.zero_known = true;
  }
  model_.step(now, temps.estimated_degC, reference.temps_degC, signals.of_model, state_.model_um);
  if (domain_) domain_->step(now, temps.estimated_degC, reference.temps_degC, signals.of_model);
  if (!curves_.empty()) look_along_travels(now, temps, reference, signals);
}

/// At this moment once more, so that no lag moves on.
void Prediction::look_along_travels(nanoseconds now, const Temperatures& temps,
                                    const ReferenceState& reference,
                                    const Signals& signals) noexcept {
  elsewhere_->copy_states(model_);
  curves_.step(
      [&](std::span<const double> at, std::span<double> out_um) {
        elsewhere_->step(now, temps.estimated_degC, reference.temps_degC, at, out_um);
      },
      signals.of_model, node_um_);
}

void Prediction::restart() noexcept {
  model_.restart();
  if (domain_) domain_->restart();
}

void Prediction::adopt(const Prediction& previous, const std::vector<int>& terms,
                       bool domain) noexcept {
  model_.adopt_terms(previous.model_, terms);
  if (domain) domain_->adopt(*previous.domain_);
  outside_share_ = previous.outside_share_;
  certainty_.adopt(previous.certainty_);
}

void Prediction::adopt_model(const Prediction& beside) noexcept {
  model_.copy_states(beside.model_);
  if (domain_ && beside.domain_) domain_->adopt(*beside.domain_);
}

void Prediction::visit_domain(StateArchive& archive) {
  if (domain_) archive(*domain_);
  archive(outside_share_);
}

}  // namespace thermocomp
