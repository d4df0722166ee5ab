#include "estimator/pipeline/certainty.hpp"

#include <algorithm>
#include <span>

namespace thermocomp {
namespace {

/// An estimate that became too uncertain serves again below this share of the limit: at the limit
/// itself a moving slide would switch it on and off.
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

}  // namespace thermocomp
