#include "estimator/cycle_hold.hpp"

#include <algorithm>

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
  held_degC_.assign(model.temperature_columns().size(), not_a_number);
  ended_degC_ = held_degC_;
  held_signals_.assign(is_position_.size(), not_a_number);
}

void CycleHold::cycle_end(nanoseconds now, std::span<const double> temps_degC,
                          std::span<const double> signals, DisplacementModel& live) noexcept {
  THERMOCOMP_ENSURE(temps_degC.size() == held_degC_.size());
  const double ahead = ended_ ? ahead_ : 0.0;
  for (std::size_t i = 0; i < held_degC_.size(); ++i) {
    const double change_K = ended_ ? temps_degC[i] - ended_degC_[i] : 0.0;
    held_degC_[i] = temps_degC[i] + ahead * change_K;
    ended_degC_[i] = temps_degC[i];
  }
  const double interval_ns = ended_ ? static_cast<double>((now - ended_at_).count()) : 0.0;
  at_ = now + nanoseconds(std::llround(ahead * interval_ns));
  ended_ = true;
  ended_at_ = now;
  model_.copy_states(live);
  hold(signals);
}

void CycleHold::restart(nanoseconds now, std::span<const double> temps_degC,
                        std::span<const double> signals) noexcept {
  THERMOCOMP_ENSURE(temps_degC.size() == held_degC_.size());
  std::copy(temps_degC.begin(), temps_degC.end(), held_degC_.begin());
  at_ = now;
  ended_ = false;
  model_.restart();
  hold(signals);
}

void CycleHold::displacement(std::span<const double> reference_degC,
                             std::span<const double> signals,
                             std::span<double> displacement_um) noexcept {
  THERMOCOMP_ENSURE(holds_ && signals.size() == held_signals_.size());
  for (std::size_t i = 0; i < signals.size(); ++i)
    if (is_position_[i]) held_signals_[i] = signals[i];
  model_.step(at_, held_degC_, reference_degC, held_signals_, displacement_um);
}

void CycleHold::restore(std::span<const double> temps_degC,
                        std::span<const double> signals) noexcept {
  THERMOCOMP_ENSURE(temps_degC.size() == held_degC_.size());
  std::copy(temps_degC.begin(), temps_degC.end(), held_degC_.begin());
  hold(signals);
}

void CycleHold::adopt(CycleHold& previous, const std::vector<int>& columns,
                      const std::vector<int>& signals, const std::vector<int>& terms) noexcept {
  take_by_plan(columns, previous.held_degC_, held_degC_);
  take_by_plan(columns, previous.ended_degC_, ended_degC_);
  take_by_plan(signals, previous.held_signals_, held_signals_);
  model_.adopt_terms(previous.model_, terms);
  at_ = previous.at_;
  ended_at_ = previous.ended_at_;
  ended_ = previous.ended_ && std::all_of(ended_degC_.begin(), ended_degC_.end(), is_finite);
  hold(held_signals_);
  holds_ = holds_ && previous.holds_;
}

/// From here on `signals` are held; a state with a hole in it is none.
void CycleHold::hold(std::span<const double> signals) noexcept {
  THERMOCOMP_ENSURE(signals.size() == held_signals_.size());
  holds_ = std::all_of(held_degC_.begin(), held_degC_.end(), is_finite);
  for (std::size_t i = 0; i < signals.size(); ++i) {
    held_signals_[i] = signals[i];
    if (!is_position_[i] && !std::isfinite(signals[i])) holds_ = false;
  }
}

}  // namespace thermocomp
