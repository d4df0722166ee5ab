#include "estimator/pipeline/reference.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

constexpr nanoseconds never = nanoseconds::min();

}  // namespace

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
        temps.refuted_at[i] - sampled_at <= young) {
      temps_degC_[i] = not_a_number;
      state.changed = true;
    }
    if (!std::isfinite(temps_degC_[i]) && temps.good[i] != 0) {
      temps_degC_[i] = temps.measured_degC[i];
      sampled_at_[i] = now;
      state.changed = true;
    }
    if (!std::isfinite(temps_degC_[i])) state.known = false;
  }
  // Of a silent controller only the last signals are known; they are not those of this moment.
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

}  // namespace thermocomp
