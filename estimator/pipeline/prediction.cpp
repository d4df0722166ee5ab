#include "estimator/pipeline/prediction.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

/// Larger values are garbled registers, whose squares would never leave the lags.
constexpr double signal_magnitude_max = 1e9;

std::vector<std::size_t> indices_of_model(const EstimatorConfig& config,
                                          const ThermalModel& model) {
  static_assert(signals_max == 48);
  require(config.signals.size() <= signals_max, "controller.signal",
          static_cast<double>(config.signals.size()), "must be at most 48");
  std::vector<std::size_t> indices;
  for (const std::string& name : model.signal_columns())
    indices.push_back(
        index_of(config.signals, name, "controller.signal", "the model needs this signal"));
  return indices;
}

std::optional<std::size_t> switch_index(const EstimatorConfig& config, const std::string& name,
                                        const char* key) {
  if (name.empty()) return std::nullopt;
  return index_of(config.signals, name, key, "is not a signal of the controller");
}

}  // namespace

SignalIntake::SignalIntake(const EstimatorConfig& config, const ThermalModel& model)
    : names_(config.signals),
      model_signals_(indices_of_model(config, model)),
      cutting_(switch_index(config, config.compensation.cutting_signal, "cutting_signal")),
      disable_(switch_index(config, config.compensation.disable_signal, "disable_signal")),
      cycle_end_(switch_index(config, config.compensation.cycle_end_signal, "cycle_end_signal")),
      stale_after_(to_nanoseconds(config.compensation.controller_stale_after_s)),
      of_model_(model_signals_.size(), not_a_number) {
  state_.last.fill(not_a_number);
}

Signals SignalIntake::step(nanoseconds now, const ControllerState& controller) noexcept {
  state_.online = controller.online && now - controller.taken_at <= stale_after_;
  Signals signals;
  signals.online = state_.online;
  signals.complete = state_.online ? take(controller) : model_signals_.empty();
  signals.of_model = of_model_;
  signals.watches_cutting = cutting_.has_value();
  signals.cutting = last_value(cutting_);
  signals.disable = last_value(disable_);
  signals.cycle_end = last_value(cycle_end_);
  return signals;
}

/// @return true if all needed signals are known
bool SignalIntake::take(const ControllerState& controller) noexcept {
  for (std::size_t i = 0; i < names_.size(); ++i)
    state_.last[i] = std::abs(controller.signals[i]) <= signal_magnitude_max ? controller.signals[i]
                                                                             : not_a_number;
  // A switch in an unknown position counts as missing: hold.
  bool complete = !disable_ || std::isfinite(last_value(disable_));
  for (std::size_t i = 0; i < model_signals_.size(); ++i) {
    of_model_[i] = state_.last[model_signals_[i]];
    complete = complete && std::isfinite(of_model_[i]);
  }
  return complete;
}

void SignalIntake::adopt(const SignalIntake& previous, const std::vector<int>& plan) noexcept {
  take_by_plan(plan, previous.of_model_, of_model_);
  // `online` is set by the next step.
  if (names_ == previous.names_) state_.last = previous.state_.last;
}

Reference::Reference(const ThermalModel& model)
    : of_model_file_(model.reference_degC),
      columns_(model.temperature_columns()),
      signal_names_(model.signal_columns()),
      temps_degC_(columns_.size(), not_a_number),
      sampled_at_(columns_.size(), never),
      signals_(signal_names_.size(), of_model_file_.empty() ? not_a_number : 0.0) {
  std::copy(of_model_file_.begin(), of_model_file_.end(), temps_degC_.begin());
}

ReferenceState Reference::step(nanoseconds now, const Temperatures& temps,
                               const Signals& signals) noexcept {
  ReferenceState state{temps_degC_, signals_, true, false};
  for (std::size_t i = 0; i < temps_degC_.size(); ++i) {
    const nanoseconds sampled_at = sampled_at_[i];
    if (sampled_at != never && temps.refuted_at[i] >= sampled_at &&
        temps.refuted_at[i] - sampled_at <= provisional_time) {
      temps_degC_[i] = not_a_number;
      state.changed = true;
    }
    if (temps.good[i] != 0) {
      if (!std::isfinite(temps_degC_[i])) {
        temps_degC_[i] = temps.measured_degC[i];
        sampled_at_[i] = now;
        state.changed = true;
      } else if (std::abs(temps.measured_degC[i] - temps_degC_[i]) > provisional_K) {
        sampled_at_[i] = never;
      }
    }
    if (!std::isfinite(temps_degC_[i])) state.known = false;
  }
  // Signals of an offline controller are outdated.
  for (std::size_t i = 0; signals.online && i < signals_.size(); ++i)
    if (!std::isfinite(signals_[i])) {
      signals_[i] = signals.of_model[i];
      state.changed = true;
    }
  return state;
}

void Reference::take(std::span<const double> temps_degC) noexcept {
  THERMOCOMP_ENSURE(temps_degC.size() == temps_degC_.size());
  std::copy(temps_degC.begin(), temps_degC.end(), temps_degC_.begin());
  std::fill(sampled_at_.begin(), sampled_at_.end(), never);
  std::fill(signals_.begin(), signals_.end(), not_a_number);
}

void Reference::restore(const std::map<std::string, double>& temps_degC,
                        const std::map<std::string, double>& signals) {
  for (std::size_t i = 0; i < columns_.size(); ++i)
    take_if_finite(temps_degC, columns_[i], temps_degC_[i]);
  for (std::size_t i = 0; i < signal_names_.size(); ++i)
    take_if_finite(signals, signal_names_[i], signals_[i]);
}

void Reference::adopt(const Reference& previous, const std::vector<int>& columns,
                      const std::vector<int>& signals) noexcept {
  if (of_model_file_ != previous.of_model_file_) return;
  take_by_plan(columns, previous.temps_degC_, temps_degC_);
  take_by_plan(columns, previous.sampled_at_, sampled_at_);
  take_by_plan(signals, previous.signals_, signals_);
}

void Reference::complete(const Reference& same) noexcept {
  for (std::size_t i = 0; i < temps_degC_.size(); ++i) {
    if (std::isfinite(temps_degC_[i])) continue;
    temps_degC_[i] = same.temps_degC_[i];
    sampled_at_[i] = same.sampled_at_[i];
  }
  for (std::size_t i = 0; i < signals_.size(); ++i)
    if (!std::isfinite(signals_[i])) signals_[i] = same.signals_[i];
}

namespace {

/// Share of the limit below which an uncertain estimate is used again: hysteresis against a moving
/// slide.
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

bool Certainty::is_accurate_enough(const LostBlocks& lost, const DisplacementModel& model,
                                   const ReferenceState& reference,
                                   const Signals& signals) noexcept {
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
    learned.step(now, temps.estimated_degC, reference.temps_degC, !signals.may_be_cutting());
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
  if (!curves_.empty()) evaluate_at_nodes(now, temps, reference, signals);
}

/// Evaluated at the same time again, so that no lag advances.
void Prediction::evaluate_at_nodes(nanoseconds now, const Temperatures& temps,
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
