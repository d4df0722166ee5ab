#include "estimator/sensing/sensing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
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

/// Compares waiting sensors with the estimate of their lost input.
void Sensing::weigh_waiting() noexcept {
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    expected_degC_[i] = lost_.estimated(i) ? lost_.temps_degC()[i] : not_a_number;
    expected_sd_K_[i] = lost_.sd_K(i);
  }
  blocks_.expect(expected_degC_, expected_sd_K_);
}

void Sensing::accept(std::size_t sensor) noexcept {
  if (blocks_.accept(sensor) && suspicion_) suspicion_->clear_history(sensor);
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

namespace {

constexpr int no_sensor = -1;
constexpr int unknown_sensor = -2;  ///< not in the previous bank

bool same(const SmoothingConfig& a, const SmoothingConfig& b) {
  return a.form == b.form && a.history == b.history && a.period_s == b.period_s &&
         a.samples == b.samples && a.half_width_K == b.half_width_K && a.outage_s == b.outage_s;
}

}  // namespace

BlockBank::Sensor::Sensor(const SensorConfig& sensor_config)
    : screening(sensor_config.screening),
      smoother(sensor_config.smoothing),
      reference(sensor_config.reference_sensor ? static_cast<int>(*sensor_config.reference_sensor)
                                               : no_sensor),
      config(sensor_config) {}

BlockBank::BlockBank(const EstimatorConfig& config, const std::vector<std::string>& columns) {
  for (const SensorConfig& sensor : config.sensors) {
    if (sensor.reference_sensor && *sensor.reference_sensor >= config.sensors.size())
      throw InvalidValue("sensor[" + sensor.name + "].reference_sensor",
                         std::to_string(*sensor.reference_sensor), "must be the index of a sensor");
    sensors_.emplace_back(sensor);
  }
  std::map<std::string, std::size_t> named;
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    const std::string& name = config.sensors[i].module;
    const std::size_t module =
        name.empty() ? modules_.size() : named.try_emplace(name, modules_.size()).first->second;
    if (module == modules_.size()) modules_.emplace_back();
    modules_[module].push_back(i);
    sensors_[i].module = module;
  }
  witnesses_.assign(modules_.size(), 0);
  refuted_at_.assign(columns.size(), never);
  for (const std::string& column : columns) {
    const auto block = std::find_if(config.blocks.begin(), config.blocks.end(),
                                    [&](const BlockConfig& each) { return each.input == column; });
    if (block == config.blocks.end())
      throw InvalidValue("model.inputs", column, "no [[block]] has this input");
    if (block->sensors.empty())
      throw InvalidValue("block[" + block->name + "].sensors", "[]", "must name a sensor");
    for (const std::size_t index : block->sensors)
      if (index >= sensors_.size())
        throw InvalidValue("block[" + block->name + "].sensors", std::to_string(index),
                           "must be the index of a sensor");
    blocks_.push_back({block->sensors, std::vector<double>(block->sensors.size(), 0.0)});
  }
  values_K_.assign(sensors_.size(), not_a_number);
  kept_K_ = values_K_;
  temps_degC_.assign(columns.size(), not_a_number);
  good_.assign(columns.size(), 0);
}

void BlockBank::read(nanoseconds now, std::span<const Reading> readings) noexcept {
  THERMOCOMP_ENSURE(readings.size() == sensors_.size());
  now_ = now;
  // All are screened before any is smoothed: a difference needs the reference of this cycle.
  waiting_ = jumped_ = 0;
  for (std::size_t i = 0; i < sensors_.size(); ++i) look_at(sensors_[i], now, readings[i]);
  for (std::size_t i = 0; i < sensors_.size(); ++i) values_K_[i] = smooth(sensors_[i], now);
}

void BlockBank::screened(nanoseconds now, std::span<double> values_K) const noexcept {
  THERMOCOMP_ENSURE(values_K.size() == sensors_.size());
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    const Sensor& sensor = sensors_[i];
    values_K[i] = sensor.screening.usable(now) ? sensor.screening.good_degC() : not_a_number;
    if (sensor.reference == no_sensor) continue;
    const Screening& reference = sensors_[static_cast<std::size_t>(sensor.reference)].screening;
    values_K[i] -= reference.usable(now) ? reference.good_degC() : not_a_number;
  }
}

bool BlockBank::join(std::span<const std::uint8_t> left_out) noexcept {
  in_use_K_ = values_K_;
  if (!left_out.empty()) {
    for (std::size_t i = 0; i < values_K_.size(); ++i)
      kept_K_[i] = left_out[i] != 0 ? not_a_number : values_K_[i];
    in_use_K_ = kept_K_;
  }
  bool all_good = true;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    good_[i] = update(blocks_[i], temps_degC_[i]) ? 1 : 0;
    all_good = all_good && good_[i] != 0;
  }
  return all_good;
}

void BlockBank::look_at(Sensor& sensor, nanoseconds now, const Reading& reading) noexcept {
  sensor.fresh = sensor.screening.step(now, reading);
  sensor.raw_degC = reading.temp_degC;
  sensor.fault = sensor.screening.fault(now);
  if (sensor.screening.waiting()) {
    ++waiting_;
    if (sensor.screening.jumped()) ++jumped_;
    return;
  }
  if (!sensor.fresh || !sensor.screening.refuted()) return;
  sensor.smoother.restart();
  note_refuted(sensor);
}

void BlockBank::note_refuted(const Sensor& sensor) noexcept {
  const auto index = static_cast<std::size_t>(&sensor - sensors_.data());
  for (std::size_t i = 0; i < blocks_.size(); ++i)
    if (std::find(blocks_[i].sensors.begin(), blocks_[i].sensors.end(), index) !=
        blocks_[i].sensors.end())
      refuted_at_[i] = sensor.screening.jumped_at();
}

void BlockBank::expect(std::span<const double> expected_degC,
                       std::span<const double> sd_K) noexcept {
  for (Sensor& sensor : sensors_) sensor.screening.expect({});
  for (const auto& module : modules_)
    if (is_not_ready(module))
      for (const std::size_t sensor : module)
        sensors_[sensor].screening.expect({not_a_number, 0.0, true});
  std::fill(witnesses_.begin(), witnesses_.end(), std::size_t{0});
  for (std::size_t i = 0; i < blocks_.size(); ++i)
    for (const std::size_t sensor : blocks_[i].sensors)
      if (good_[i] != 0) ++witnesses_[sensors_[sensor].module];
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    if (std::isnan(expected_degC[i])) continue;
    for (std::size_t k = 0; k < blocks_[i].sensors.size(); ++k) {
      Sensor& sensor = sensors_[blocks_[i].sensors[k]];
      if (!sensor.screening.waiting() || !has_other_witness(sensor.module)) continue;
      double expected = expected_degC[i] + blocks_[i].deviation_K[k];
      if (sensor.reference != no_sensor) {
        const Screening& reference = sensors_[static_cast<std::size_t>(sensor.reference)].screening;
        expected += reference.usable(now_) ? reference.good_degC() : not_a_number;
      }
      sensor.screening.expect({expected, sd_K[i], false});
    }
  }
}

/// True if all channels that answer show one value, although their last good values differed, and
/// one of them is far from its own: a module that answers before its first conversion.
bool BlockBank::is_not_ready(const std::vector<std::size_t>& module) const noexcept {
  double least_degC = std::numeric_limits<double>::infinity();
  double most_degC = -least_degC;
  double off_K = 0.0;
  double shown_degC = not_a_number;
  for (const std::size_t i : module) {
    const Screening& screening = sensors_[i].screening;
    if (screening.usable(now_)) return false;
    if (!screening.shows_unconfirmed()) continue;  // another fault, such as an open circuit
    if (std::isnan(shown_degC)) shown_degC = screening.newest_degC();
    if (screening.newest_degC() != shown_degC) return false;
    if (!screening.has_good()) continue;
    least_degC = std::min(least_degC, screening.good_degC());
    most_degC = std::max(most_degC, screening.good_degC());
    off_K = std::max(off_K, std::abs(shown_degC - screening.good_degC()));
  }
  const double allowed_K = sensors_[module.front()].config.screening.rate_allowance_K;
  return most_degC - least_degC > allowed_K || (most_degC > least_degC && off_K > allowed_K);
}

/// True if a sensor of another module is in a good column.
bool BlockBank::has_other_witness(std::size_t module) const noexcept {
  for (std::size_t i = 0; i < witnesses_.size(); ++i)
    if (i != module && witnesses_[i] > 0) return true;
  return false;
}

void BlockBank::restore_jump(const std::string& name, double from_degC) {
  for (Sensor& sensor : sensors_)
    if (sensor.config.name == name) sensor.screening.restore_jump(from_degC);
}

bool BlockBank::accept(std::size_t index) noexcept {
  Sensor& sensor = sensors_[index];
  if (!sensor.screening.accept()) return false;
  if (sensor.screening.refuted()) note_refuted(sensor);
  sensor.smoother.restart();
  sensor.fault = sensor.screening.fault(now_);
  sensor.fresh = true;
  values_K_[index] = smooth(sensor, now_);
  return true;
}

double BlockBank::smooth(Sensor& sensor, nanoseconds now) noexcept {
  double reference_degC = 0.0;
  bool usable = sensor.screening.usable(now);
  if (sensor.reference != no_sensor) {
    const Screening& reference = sensors_[static_cast<std::size_t>(sensor.reference)].screening;
    usable = usable && reference.usable(now);
    reference_degC = reference.good_degC();
  }
  if (sensor.fresh && usable)
    sensor.smoother.add(
        {sensor.screening.good_at(), sensor.screening.good_degC() - reference_degC});
  return usable && sensor.smoother.has_value() ? sensor.smoother.value_K() : not_a_number;
}

bool BlockBank::update(Block& block, double& temp_degC) noexcept {
  double sum_degC = 0.0;
  for (const std::size_t sensor : block.sensors) sum_degC += in_use_K_[sensor];
  if (std::isnan(sum_degC)) return update_without_the_missing(block, temp_degC);
  temp_degC = sum_degC / static_cast<double>(block.sensors.size());
  for (std::size_t i = 0; i < block.sensors.size(); ++i)
    block.deviation_K[i] = values_K_[block.sensors[i]] - temp_degC;
  return true;
}

bool BlockBank::update_without_the_missing(const Block& block, double& temp_degC) const noexcept {
  double sum_degC = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < block.sensors.size(); ++i) {
    const double value_K = in_use_K_[block.sensors[i]];
    if (std::isnan(value_K)) continue;
    sum_degC += value_K - block.deviation_K[i];
    ++count;
  }
  if (count > 0) temp_degC = sum_degC / static_cast<double>(count);
  return count > 0;
}

void BlockBank::continue_from(std::size_t column, double temp_degC) noexcept {
  Block& block = blocks_[column];
  for (std::size_t i = 0; i < block.sensors.size(); ++i)
    if (const double value_K = values_K_[block.sensors[i]]; std::isfinite(value_K))
      block.deviation_K[i] = value_K - temp_degC;
}

void BlockBank::report(std::span<SensorReport> sensors) const noexcept {
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    const Sensor& sensor = sensors_[i];
    sensors[i] = {sensor.raw_degC,
                  sensor.smoother.has_value() ? sensor.smoother.value_K() : not_a_number,
                  sensor.screening.good_at(),
                  sensor.fault,
                  sensor.smoother.clipped_in_a_row(),
                  sensor.smoother.clipped(),
                  sensor.screening.rejected(),
                  sensor.screening.waiting(),
                  sensor.screening.jumped(),
                  sensor.screening.jump_K(),
                  sensor.screening.jumped_from_degC(),
                  sensor.screening.jumped_at(),
                  false,
                  false,
                  0.0,
                  {}};
  }
}

void BlockBank::visit_state(StateArchive& archive) {
  for (Sensor& sensor : sensors_) archive(sensor);
  for (Block& block : blocks_) archive(block.deviation_K);
  archive(temps_degC_, good_, now_, waiting_, jumped_, refuted_at_);
}

void BlockBank::plan_adoption(const BlockBank& previous) {
  sensor_plan_.clear();
  for (const Sensor& sensor : sensors_) {
    const auto found =
        std::find_if(previous.sensors_.begin(), previous.sensors_.end(),
                     [&](const Sensor& each) { return each.config.name == sensor.config.name; });
    sensor_plan_.push_back(found == previous.sensors_.end()
                               ? -1
                               : static_cast<int>(found - previous.sensors_.begin()));
  }
  block_plan_.clear();
  for (const Block& block : blocks_) {
    const auto found =
        std::find_if(previous.blocks_.begin(), previous.blocks_.end(), [&](const Block& each) {
          // By name, since a new file may number sensors differently.
          return std::equal(block.sensors.begin(), block.sensors.end(), each.sensors.begin(),
                            each.sensors.end(), [&](std::size_t ours, std::size_t theirs) {
                              return sensor_plan_[ours] == static_cast<int>(theirs);
                            });
        });
    block_plan_.push_back(
        found == previous.blocks_.end() ? -1 : static_cast<int>(found - previous.blocks_.begin()));
  }
}

int BlockBank::previous_reference(const Sensor& sensor) const noexcept {
  if (sensor.reference == no_sensor) return no_sensor;
  const int previous = sensor_plan_[static_cast<std::size_t>(sensor.reference)];
  return previous < 0 ? unknown_sensor : previous;
}

void BlockBank::adopt(const BlockBank& previous) noexcept {
  now_ = previous.now_;
  waiting_ = previous.waiting_;
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    if (sensor_plan_[i] < 0) continue;
    const Sensor& other = previous.sensors_[static_cast<std::size_t>(sensor_plan_[i])];
    Sensor& sensor = sensors_[i];
    sensor.screening.adopt(other.screening);
    sensor.raw_degC = other.raw_degC;
    sensor.fault = other.fault;
    if (!same(sensor.config.smoothing, other.config.smoothing) ||
        previous_reference(sensor) != other.reference)
      continue;
    sensor.smoother = other.smoother;  // same sizes: no allocation
  }
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    if (block_plan_[i] < 0) continue;
    const auto other = static_cast<std::size_t>(block_plan_[i]);
    blocks_[i].deviation_K = previous.blocks_[other].deviation_K;
    temps_degC_[i] = previous.temps_degC_[other];
    good_[i] = previous.good_[other];
    refuted_at_[i] = previous.refuted_at_[other];
  }
}

}  // namespace thermocomp
