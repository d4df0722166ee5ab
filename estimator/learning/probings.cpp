#include "estimator/learning/probings.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "estimator/name_index.hpp"

namespace thermocomp {

Probings::Probings(const EstimatorConfig& config, const ThermalModel& model,
                   const std::vector<std::size_t>& axis_output)
    : axis_names_(entry_names(config.axes)),
      is_on_(config.correction.form != CorrectionForm::off),
      meaning_(config.correction.measured),
      errors_(config.axes.size()),
      measured_um_(config.axes.size(), not_a_number),
      operator_um_(config.axes.size()),
      past_(is_on_ ? past_moments * config.axes.size() : 0),
      rise_K_(model.temperature_columns().size(), 0.0) {
  for (const std::size_t output : axis_output)
    corrections_.emplace_back(config.correction, model, output);
}

void Probings::step(nanoseconds now, const Temperatures& temps, const ReferenceState& reference,
                    bool may_change) noexcept {
  for (std::size_t i = 0; i < rise_K_.size(); ++i)
    rise_K_[i] = temps.estimated_degC[i] - reference.temps_degC[i];
  for (RunningCorrection& correction : corrections_) correction.step(now, rise_K_, may_change);
  if (!may_change) return;
  for (OperatorOffset& each : operator_um_) each.absorbed_um = each.learned_um;
}

void Probings::learn(std::size_t axis, const MeasuredValue& measured,
                     const PastMoment& moment) noexcept {
  OperatorOffset& entered = operator_um_[axis];
  const double total_um = without_offset_um(measured.value_um, moment);
  errors_[axis].take(total_um - moment.model_um);
  const double before_um = corrections_[axis].learned_um();
  corrections_[axis].measured({total_um, moment.model_um, measured.sd_um, moment.contributions_um});
  if (measured.source != MeasuredSource::wear || !is_on_ || !std::isfinite(measured.value_um))
    return;
  entered.entered_um += measured.value_um;
  entered.learned_um += corrections_[axis].learned_um() - before_um;
}

PastMoment Probings::present(std::size_t axis, double compensated_um,
                             double model_um) const noexcept {
  return {{},
          compensated_um,
          model_um,
          operator_um_[axis].entered_um,
          corrections_[axis].contributions_um()};
}

const PastMoment* Probings::past(std::size_t axis, nanoseconds at) const noexcept {
  const PastMoment* nearest = nullptr;
  for (std::size_t i = 0; i < (is_on_ ? past_moments : 0); ++i) {
    const PastMoment& each = past_[axis * past_moments + i];
    if (!std::isfinite(each.model_um)) continue;
    if (nearest == nullptr || std::chrono::abs(each.at - at) < std::chrono::abs(nearest->at - at))
      nearest = &each;
  }
  const bool is_there = nearest != nullptr && std::chrono::abs(nearest->at - at) <= 2 * past_pitch;
  return is_there ? nearest : nullptr;
}

void Probings::remember(std::size_t axis, const PastMoment& moment) noexcept {
  if (moment.at != remembered_at_) {
    next_past_ = (next_past_ + 1) % past_moments;
    remembered_ = std::min(remembered_ + 1, past_moments);
  }
  remembered_at_ = moment.at;
  past_[axis * past_moments + next_past_] = moment;
}

void Probings::restart() noexcept {
  for (RunningCorrection& correction : corrections_) correction.restart();
  std::fill(operator_um_.begin(), operator_um_.end(), OperatorOffset{});
  std::fill(past_.begin(), past_.end(), PastMoment{});
  remembered_ = 0;
}

void Probings::restore(const std::map<std::string, double>& corrections) {
  for (std::size_t i = 0; i < corrections_.size(); ++i) {
    corrections_[i].restore(corrections, axis_names_[i]);
    const auto bounded = [&](const char* key) {
      double value_um = 0.0;
      take_if_finite(corrections, axis_names_[i] + key, value_um);
      return std::abs(value_um) <= offset_um_max_of_any_axis ? value_um : 0.0;
    };
    operator_um_[i].entered_um = bounded(".entered_um");
    operator_um_[i].absorbed_um = operator_um_[i].learned_um = bounded(".absorbed_um");
  }
}

void Probings::adopt(const Probings& previous, const std::vector<int>& axes) noexcept {
  take_by_plan(axes, previous.measured_um_, measured_um_);
  take_by_plan(axes, previous.errors_, errors_);
  take_by_plan(axes, previous.operator_um_, operator_um_);
  for (std::size_t i = 0; i < axes.size(); ++i)
    if (axes[i] >= 0)
      corrections_[i].adopt(previous.corrections_[static_cast<std::size_t>(axes[i])]);
}

void Probings::visit_learned(StateArchive& archive) {
  for (RunningCorrection& correction : corrections_) archive(correction);
  for (ProbedError& error : errors_) archive(error);
}

void Probings::visit_operators(StateArchive& archive) {
  for (OperatorOffset& each : operator_um_)
    archive(each.entered_um, each.absorbed_um, each.learned_um);
  for (PastMoment& each : past_)
    archive(each.at, each.compensated_um, each.model_um, each.entered_um, each.contributions_um);
  archive(next_past_, remembered_, remembered_at_);
}

}  // namespace thermocomp
