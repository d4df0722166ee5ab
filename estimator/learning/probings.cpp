#include "estimator/learning/probings.hpp"

#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

std::vector<std::string> names_of(const std::vector<AxisConfig>& axes) {
  std::vector<std::string> names;
  names.reserve(axes.size());
  for (const AxisConfig& axis : axes) names.push_back(axis.name);
  return names;
}

}  // namespace

Probings::Probings(const EstimatorConfig& config, const ThermalModel& model,
                   const std::vector<std::size_t>& axis_output)
    : axis_names_(names_of(config.axes)),
      errors_(config.axes.size()),
      measured_um_(config.axes.size(), not_a_number),
      rise_K_(model.temperature_columns().size(), 0.0) {
  for (const std::size_t output : axis_output)
    corrections_.emplace_back(config.correction, model, output);
}

void Probings::step(nanoseconds now, const Temperatures& temps, const ReferenceState& reference,
                    bool may_change) noexcept {
  for (std::size_t i = 0; i < rise_K_.size(); ++i)
    rise_K_[i] = temps.estimated_degC[i] - reference.temps_degC[i];
  for (RunningCorrection& correction : corrections_) correction.step(now, rise_K_, may_change);
}

void Probings::learn(std::size_t axis, double total_um, double model_um) noexcept {
  errors_[axis].take(total_um - model_um);
  corrections_[axis].measured(total_um, model_um);
}

void Probings::restart() noexcept {
  for (RunningCorrection& correction : corrections_) correction.restart();
}

void Probings::restore(const std::map<std::string, double>& corrections) {
  for (std::size_t i = 0; i < corrections_.size(); ++i)
    corrections_[i].restore(corrections, axis_names_[i]);
}

void Probings::adopt(const Probings& previous, const std::vector<int>& axes) noexcept {
  take_by_plan(axes, previous.measured_um_, measured_um_);
  take_by_plan(axes, previous.errors_, errors_);
  for (std::size_t i = 0; i < axes.size(); ++i)
    if (axes[i] >= 0)
      corrections_[i].adopt(previous.corrections_[static_cast<std::size_t>(axes[i])]);
}

void Probings::visit_learned(StateArchive& archive) {
  for (RunningCorrection& correction : corrections_) archive(correction);
  for (ProbedError& error : errors_) archive(error);
}

}  // namespace thermocomp
