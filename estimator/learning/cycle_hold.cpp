#include "estimator/learning/cycle_hold.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

bool is_finite(double value) noexcept {
  return std::isfinite(value);
}

}  // namespace

CycleHold::CycleHold(const ThermalModel& model, double ahead) : ahead_(ahead), model_(model) {
  require(ahead >= 0.0 && ahead <= 1.0, "cycle_ahead", ahead, "must be in [0, 1]");
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

/// From here on `signals` are held; a state with a hole in it is none.
void CycleHold::hold(std::span<const double> signals) noexcept {
  THERMOCOMP_ENSURE(signals.size() == state_.held_signals.size());
  state_.holds = std::all_of(state_.held_degC.begin(), state_.held_degC.end(), is_finite);
  for (std::size_t i = 0; i < signals.size(); ++i) {
    state_.held_signals[i] = signals[i];
    if (!is_position_[i] && !std::isfinite(signals[i])) state_.holds = false;
  }
}

}  // namespace thermocomp
