#include "estimator/sensing/sensing.hpp"

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
  // Signals of an offline controller are not those of this moment.
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

/// The model for LostBlocks: without covariance if blocks are not to be estimated.
ThermalModel estimating_model(const ThermalModel& model, const EstimatorConfig& config) {
  ThermalModel seen = model;
  if (!config.compensation.estimate_lost_blocks) seen.covariance_K2.clear();
  return seen;
}

/// Longest time until the first value of a working sensor is confirmed.
nanoseconds settling_time(const EstimatorConfig& config) {
  double longest_s = 0.0;
  for (const SensorConfig& sensor : config.sensors)
    longest_s = std::max(longest_s, sensor.screening.stale_after_s + sensor.screening.settle_s);
  return to_nanoseconds(longest_s);
}

}  // namespace

Sensing::Sensing(const EstimatorConfig& config, const ThermalModel& model)
    : columns_(model.temperature_columns()),
      blocks_(config, columns_),
      lost_(estimating_model(model, config), settling_time(config)),
      screened_K_(config.sensors.size(), not_a_number),
      expected_degC_(columns_.size(), not_a_number),
      expected_sd_K_(columns_.size(), 0.0) {
  if (config.compensation.suspected_sensors != SuspectedPolicy::off &&
      !model.covariance_K2.empty() && model.inputs.size() >= NeighbourCheck::inputs_min)
    suspicion_.emplace(config, model);
}

Temperatures Sensing::step(nanoseconds now, std::span<const Reading> readings) noexcept {
  if (blocks_.waiting() > 0) weigh_waiting();
  blocks_.read(now, readings);
  return join(now, suspect(now));
}

/// A waiting sensor must agree with the estimate of its lost input.
void Sensing::weigh_waiting() noexcept {
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    expected_degC_[i] = lost_.estimated(i) ? lost_.temps_degC()[i] : not_a_number;
    expected_sd_K_[i] = lost_.sd_K(i);
  }
  blocks_.surround(expected_degC_, expected_sd_K_);
}

void Sensing::accept(std::size_t sensor) noexcept {
  if (blocks_.accept(sensor) && suspicion_) suspicion_->begin_anew(sensor);
}

/// @return one per sensor: 1 excludes it; empty: none
std::span<const std::uint8_t> Sensing::suspect(nanoseconds now) noexcept {
  if (!suspicion_) return {};
  if (suspicion_->is_due(now)) {
    blocks_.screened(now, screened_K_);
    suspicion_->step(now, screened_K_);
    for (const Suspicion::Corrected& input : suspicion_->newly_weighed_down()) {
      blocks_.continue_from(input.input, input.temp_degC);
      lost_.continue_from(input.input, input.temp_degC, input.sd_K);
    }
  }
  return suspicion_->count() > 0 ? suspicion_->weighed_down() : std::span<const std::uint8_t>{};
}

Temperatures Sensing::join(nanoseconds now, std::span<const std::uint8_t> left_out) noexcept {
  Temperatures temps;
  temps.all_good = blocks_.join(left_out);
  lost_.step(now, blocks_.temps_degC(), blocks_.good());
  temps.measured_degC = blocks_.temps_degC();
  temps.good = blocks_.good();
  temps.refuted_at = blocks_.refuted_at();
  temps.estimated_degC = lost_.temps_degC();
  temps.complete = lost_.complete();
  temps.jumped = blocks_.jumped() > 0;
  temps.suspected = suspicion_ && suspicion_->count() > 0;
  temps.weighed_down = std::find(left_out.begin(), left_out.end(), 1) != left_out.end();
  return temps;
}

Temperatures Sensing::use_all(nanoseconds now) noexcept {
  if (suspicion_) suspicion_->use_all();
  return join(now, {});
}

void Sensing::end_suspicions() noexcept {
  if (suspicion_) suspicion_->restart();
}

void Sensing::report(std::span<SensorReport> sensors) const noexcept {
  blocks_.report(sensors);
  if (suspicion_) suspicion_->report(sensors);
}

bool Sensing::all_good() const noexcept {
  const auto good = blocks_.good();
  return std::all_of(good.begin(), good.end(), [](std::uint8_t each) { return each != 0; });
}

void Sensing::restore(const std::map<std::string, double>& temps_degC,
                      const std::map<std::string, double>& jumped_from_degC) {
  for (const auto& [sensor, from_degC] : jumped_from_degC) blocks_.restore_jump(sensor, from_degC);
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    double temp_degC = not_a_number;
    take_if_finite(temps_degC, columns_[i], temp_degC);
    lost_.restore(i, temp_degC);
  }
}

void Sensing::plan_adoption(const Sensing& previous) {
  blocks_.plan_adoption(previous.blocks_);
  lost_.plan_adoption(previous.lost_);
  if (suspicion_ && previous.suspicion_) suspicion_->plan_adoption(*previous.suspicion_);
}

void Sensing::adopt(const Sensing& previous) noexcept {
  blocks_.adopt(previous.blocks_);
  lost_.adopt(previous.lost_);
  if (suspicion_ && previous.suspicion_) suspicion_->adopt(*previous.suspicion_);
}

}  // namespace thermocomp
