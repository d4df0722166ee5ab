#include "estimator/pipeline/prediction.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace thermocomp {
namespace {

/// Share of the limit below which an uncertain estimate is used again, so that a moving slide does
/// not switch it on and off.
constexpr double certain_again = 0.9;

}  // namespace

Certainty::Certainty(const EstimatorConfig& config, const ThermalModel& model,
                     const std::vector<std::size_t>& axis_output)
    : sd_um_max_(config.compensation.offset_sd_um_max),
      axis_output_(axis_output),
      places_(node_places(config, model)),
      rise_K_(model.temperature_columns().size(), 0.0),
      slope_um_per_K_(rise_K_.size(), 0.0),
      signals_(model.signal_columns().size(), 0.0) {
  state_.offset_sd_um.assign(axis_output_.size(), 0.0);
}

bool Certainty::step(const LostBlocks& lost, const DisplacementModel& model,
                     const ReferenceState& reference, const Signals& signals) noexcept {
  std::fill(state_.offset_sd_um.begin(), state_.offset_sd_um.end(), 0.0);
  if (!lost.complete()) return false;
  if (lost.lost_count() == 0) {
    state_.uncertain = false;
    return true;
  }
  if (!signals.complete || !reference.known) return !state_.uncertain;
  note_rise(lost, reference);
  const double limit_um = sd_um_max_ * (state_.uncertain ? certain_again : 1.0);
  state_.uncertain = false;
  for (std::size_t i = 0; i < axis_output_.size(); ++i) {
    state_.offset_sd_um[i] = sd_um(i, lost, model, signals);
    // Negated so that NaN is uncertain.
    if (!(state_.offset_sd_um[i] <= limit_um)) state_.uncertain = true;
  }
  return !state_.uncertain;
}

bool Certainty::would_serve(const LostBlocks& lost, const DisplacementModel& model,
                            const ReferenceState& reference, const Signals& signals) noexcept {
  if (!lost.complete()) return false;
  if (lost.lost_count() == 0 || !signals.complete || !reference.known) return true;
  note_rise(lost, reference);
  for (std::size_t i = 0; i < axis_output_.size(); ++i)
    if (!(sd_um(i, lost, model, signals) <= certain_again * sd_um_max_)) return false;
  return true;
}

void Certainty::note_rise(const LostBlocks& lost, const ReferenceState& reference) noexcept {
  for (std::size_t i = 0; i < rise_K_.size(); ++i)
    rise_K_[i] = lost.temps_degC()[i] - reference.temps_degC[i];
}

double Certainty::sd_um(std::size_t axis, const LostBlocks& lost, const DisplacementModel& model,
                        const Signals& signals) noexcept {
  std::span<const double> at = signals.of_model;
  if (places_[axis].is_node) {
    std::copy(at.begin(), at.end(), signals_.begin());
    signals_[places_[axis].signal] = places_[axis].position_mm;
    at = signals_;
  }
  model.slope(axis_output_[axis], rise_K_, at, slope_um_per_K_);
  return lost.sd_of(slope_um_per_K_);
}

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
    // Good inputs and a valid model may still give a result that is not finite.
    found.known = std::all_of(axis_um_.begin(), axis_um_.end(),
                              [](double value_um) { return std::isfinite(value_um); });
    found.not_finite = !found.known;
  }
  found.outside = outside();
  found.held = policy_ == OutsidePolicy::hold && found.outside;
  if (domain_ && found.known) outside_share_.step(now, found.outside);
  found.used_share = used_share();
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

/// At the same time again, so that no lag advances.
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
