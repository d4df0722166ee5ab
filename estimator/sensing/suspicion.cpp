#include "estimator/sensing/suspicion.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"
#include "estimator/sensing/sensor.hpp"

namespace thermocomp {
namespace {

constexpr nanoseconds look_period = std::chrono::seconds(12);
constexpr nanoseconds tick_period = std::chrono::seconds(60);
/// A longer pause clears the history.
constexpr nanoseconds pause_max = std::chrono::minutes(5);

/// Two lines of five values with white noise of variance v, extrapolated by 2.5 ticks each, differ
/// by 2 v (1/5 + 2.5^2/10) = 1.65 v; the file's growth gives 2 v for a change between two ticks.
/// Limit: 2.2 times the largest of undisturbed hours (1.8: hours 0-16 of the spindle with the
/// covariance of hours 16-32).
constexpr ChangeAsked jump_asked{60.0, 0.825, 4.0};
/// Largest scatter of the ticks about their lines, as a share of the step: for a step one tick away
/// the scatter is as large as its apparent size.
constexpr double misfit_share = 0.25;
/// Share of the step by which the level must have moved, against spikes (such as that of t16 in
/// hours 16-32); a plain half.
constexpr double held_share = 0.5;
/// 1.4 times the largest of the same hours over all ages (4.3).
constexpr double creep_sd_limit = 6.0;
/// Longer than a door stays open; half the shortest age of a creep.
constexpr std::uint32_t creep_ticks_min = 30;
constexpr std::array<std::size_t, 3> creep_levels_back{4, 16, 48};  ///< 1, 4 and 12 h
/// A suspicion ends when less than this share of its first error is left: a third, so that drift
/// alone neither ends nor begins one.
constexpr double over_share = 0.35;
constexpr std::uint32_t over_ticks = 10;
/// In a block, the others agree if off by less than this share of the suspect's error.
constexpr double others_share = 1.0 / 3.0;

/// Median of the finite values; NaN if fewer than `enough`. Reorders.
double median_of(std::span<double> values, std::size_t enough) noexcept {
  const auto end =
      std::partition(values.begin(), values.end(), [](double each) { return std::isfinite(each); });
  const auto count = static_cast<std::size_t>(end - values.begin());
  if (count < enough) return not_a_number;
  std::sort(values.begin(), end);
  return 0.5 * (values[(count - 1) / 2] + values[count / 2]);
}

std::vector<std::vector<std::size_t>> sensors_of_inputs(const EstimatorConfig& config,
                                                        const ThermalModel& model) {
  std::vector<std::vector<std::size_t>> sensors;
  for (const std::string& input : model.inputs) {
    const auto block = std::find_if(config.blocks.begin(), config.blocks.end(),
                                    [&](const BlockConfig& each) { return each.input == input; });
    if (block == config.blocks.end())
      throw InvalidValue("model.inputs", input, "no [[block]] has this input");
    sensors.push_back(block->sensors);
  }
  return sensors;
}

std::vector<std::string> names_of(const EstimatorConfig& config) {
  std::vector<std::string> names;
  for (const SensorConfig& sensor : config.sensors) names.push_back(sensor.name);
  return names;
}

std::vector<std::string> references_of(const EstimatorConfig& config) {
  std::vector<std::string> names;
  for (const SensorConfig& sensor : config.sensors)
    names.push_back(sensor.reference_sensor ? config.sensors[*sensor.reference_sensor].name : "");
  return names;
}

}  // namespace

Suspicion::Suspicion(const EstimatorConfig& config, const ThermalModel& model)
    : names_(names_of(config)),
      references_(references_of(config)),
      may_weigh_down_(config.compensation.suspected_sensors == SuspectedPolicy::weigh_down &&
                      config.compensation.estimate_lost_blocks),
      inputs_(sensors_of_inputs(config, model)),
      check_(model),
      changes_K_(names_.size(), not_a_number),
      input_changes_K_(inputs_.size(), not_a_number),
      errors_K_(inputs_.size(), not_a_number),
      misfit_K_(names_.size(), 0.0),
      creeps_(names_.size(), 0),
      corrected_(inputs_.size() + names_.size()) {
  const std::size_t n = names_.size();
  state_.looked_K.assign(n * looks, not_a_number);
  state_.ticks_K.assign(n * ticks_kept, not_a_number);
  state_.levels_K.assign(n * levels_kept, not_a_number);
  state_.suspected.assign(n, 0);
  state_.weighed_down.assign(n, 0);
  state_.size_K.assign(n, 0.0);
  state_.found_K.assign(n, 0.0);
  state_.since.assign(n, nanoseconds{});
  state_.agreed_ticks.assign(n, 0);
  state_.missing_ticks.assign(n, 0);
  state_.creep_ticks.assign(n, 0);
}

void Suspicion::step(nanoseconds now, std::span<const double> values_K) noexcept {
  THERMOCOMP_ENSURE(values_K.size() == names_.size());
  corrected_count_ = 0;
  if (!is_due(now)) return;
  if (!state_.started || now - state_.last_look > pause_max) {
    state_.started = true;
    state_.tick_begin = now;
    state_.looked = 0;
    state_.ticks_since_level = 0;
    for (std::size_t i = 0; i < names_.size(); ++i) forget(i);
  }
  if (now - state_.tick_begin >= tick_period) close_tick(now);
  if (state_.looked < looks) {
    for (std::size_t i = 0; i < names_.size(); ++i)
      state_.looked_K[i * looks + state_.looked] = values_K[i];
    ++state_.looked;
  }
  state_.last_look = now;
  state_.next_look += look_period;
  if (state_.next_look <= now || state_.next_look > now + look_period)
    state_.next_look = now + look_period;
}

/// @param back  0: the newest
double& Suspicion::tick(std::size_t sensor, std::size_t back) noexcept {
  const std::size_t place = (state_.next_tick + ticks_kept - 1 - back) % ticks_kept;
  return state_.ticks_K[sensor * ticks_kept + place];
}

/// @param back  ticks ago
double Suspicion::level_K(std::size_t sensor, std::size_t back) noexcept {
  std::array<double, line_ticks> values{};
  for (std::size_t i = 0; i < line_ticks; ++i) values[i] = tick(sensor, back + i);
  return median_of(values, line_ticks - 2);
}

/// Step between the line through the newest ticks and that through those before, where they meet.
double Suspicion::jump_K(std::size_t sensor) noexcept {
  constexpr nanoseconds meet = tick_period / 2 - static_cast<int>(line_ticks) * tick_period;
  double jump_K = 0.0;
  misfit_K_[sensor] = 0.0;
  for (const bool newest : {false, true}) {
    std::array<Sample, line_ticks> samples;
    std::size_t count = 0;
    for (std::size_t i = 0; i < line_ticks; ++i) {
      const std::size_t back = newest ? i : line_ticks + i;
      const double value_K = tick(sensor, back);
      if (std::isfinite(value_K))
        samples[count++] = {-static_cast<std::int64_t>(back) * tick_period, value_K};
    }
    if (count < line_ticks - 1) return not_a_number;
    const Line line = fit_line({samples.data(), count});
    jump_K += (newest ? 1.0 : -1.0) * line.at(meet);
    double square_K2 = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double off_K = samples[i].value_K - line.at(samples[i].at);
      square_K2 += off_K * off_K / static_cast<double>(count);
    }
    misfit_K_[sensor] = std::max(misfit_K_[sensor], std::sqrt(square_K2));
  }
  return jump_K;
}

void Suspicion::close_tick(nanoseconds now) noexcept {
  state_.tick_begin += tick_period;
  if (now - state_.tick_begin >= tick_period) state_.tick_begin = now;
  state_.next_tick = (state_.next_tick + 1) % ticks_kept;
  for (std::size_t i = 0; i < names_.size(); ++i)
    tick(i, 0) = median_of({state_.looked_K.data() + i * looks, state_.looked}, 1);
  state_.looked = 0;
  ++state_.ticks_since_level;
  follow_suspected();
  look_for_jumps(now);
  std::fill(creeps_.begin(), creeps_.end(), std::uint8_t{0});
  for (const std::size_t back : creep_levels_back) look_for_creep(now, back);
  for (std::size_t i = 0; i < names_.size(); ++i)
    state_.creep_ticks[i] = creeps_[i] != 0 ? state_.creep_ticks[i] + 1 : 0;
  if (state_.ticks_since_level >= ticks_a_level) keep_levels();
}

void Suspicion::keep_levels() noexcept {
  state_.ticks_since_level = 0;
  for (std::size_t i = 0; i < names_.size(); ++i)
    state_.levels_K[i * levels_kept + state_.next_level] =
        state_.suspected[i] != 0 ? not_a_number : level_K(i, 0);
  state_.next_level = (state_.next_level + 1) % levels_kept;
}

void Suspicion::look_for_jumps(nanoseconds now) noexcept {
  for (std::size_t i = 0; i < names_.size(); ++i) changes_K_[i] = jump_K(i);
  join_changes();
  const NeighbourCheck::Answer answer = check_.find(input_changes_K_, jump_asked);
  std::array<Suspect, NeighbourCheck::wrong_max> suspects;
  for (std::size_t i = 0; i < answer.count; ++i) suspects[i] = suspect_of(answer.wrong[i]);
  for (std::size_t i = 0; i < answer.count; ++i) {
    const Suspect& suspect = suspects[i];
    // A step within one of the lines gives a wrong size.
    if (!suspect.found || !(misfit_K_[suspect.sensor] <= misfit_share * std::abs(suspect.size_K)))
      continue;
    if (lasting_change_K(suspect, answer) / suspect.size_K >= held_share)
      begin(suspect, now - static_cast<int>(line_ticks) * tick_period);
  }
}

/// Change of the level minus that of the neighbours; near 0 after a spike.
double Suspicion::lasting_change_K(const Suspect& suspect,
                                   const NeighbourCheck::Answer& answer) noexcept {
  for (std::size_t i = 0; i < names_.size(); ++i)
    changes_K_[i] = level_K(i, 0) - level_K(i, line_ticks);
  join_changes();
  for (std::size_t i = 0; i < answer.count; ++i)
    if (answer.wrong[i].input != suspect.input)
      input_changes_K_[answer.wrong[i].input] = not_a_number;
  const double own_K = check_.remainder_K(suspect.input, input_changes_K_);
  return changes_K_[suspect.sensor] - (input_changes_K_[suspect.input] - own_K);
}

void Suspicion::look_for_creep(nanoseconds now, std::size_t levels_back) noexcept {
  const std::size_t place = (state_.next_level + levels_kept - levels_back) % levels_kept;
  for (std::size_t i = 0; i < names_.size(); ++i)
    changes_K_[i] = level_K(i, 0) - state_.levels_K[i * levels_kept + place];
  join_changes();
  const double ticks_ago =
      static_cast<double>((levels_back - 1) * ticks_a_level + state_.ticks_since_level);
  const NeighbourCheck::Answer answer =
      check_.find(input_changes_K_, {60.0 * ticks_ago, 1.0, creep_sd_limit});
  for (std::size_t i = 0; i < answer.count; ++i) {
    const Suspect suspect = suspect_of(answer.wrong[i]);
    if (!suspect.found) continue;
    creeps_[suspect.sensor] = 1;
    if (state_.creep_ticks[suspect.sensor] >= creep_ticks_min) begin(suspect, now);
  }
}

void Suspicion::join_changes() noexcept {
  for (std::size_t input = 0; input < inputs_.size(); ++input) {
    double sum_K = 0.0;
    std::size_t count = 0;
    for (const std::size_t sensor : inputs_[input]) {
      if (state_.suspected[sensor] != 0 || !std::isfinite(changes_K_[sensor])) continue;
      sum_K += changes_K_[sensor];
      ++count;
    }
    input_changes_K_[input] = count > 0 ? sum_K / static_cast<double>(count) : not_a_number;
  }
}

/// The wrong sensor of the input, if only one is wrong.
Suspicion::Suspect Suspicion::suspect_of(const NeighbourCheck::Wrong& wrong) const noexcept {
  const double expected_K = input_changes_K_[wrong.input] - wrong.size_K;
  double sum_K = 0.0;
  double largest_K = 0.0;
  std::size_t count = 0;
  std::size_t named = 0;
  for (const std::size_t sensor : inputs_[wrong.input]) {
    if (state_.suspected[sensor] != 0 || !std::isfinite(changes_K_[sensor])) continue;
    const double off_K = changes_K_[sensor] - expected_K;
    sum_K += off_K;
    ++count;
    if (std::abs(off_K) < std::abs(largest_K)) continue;
    largest_K = off_K;
    named = sensor;
  }
  if (count == 0) return {};
  const double others_K = count > 1 ? (sum_K - largest_K) / static_cast<double>(count - 1) : 0.0;
  const bool found = std::abs(others_K) <= others_share * std::abs(largest_K);
  return {found, named, wrong.input, largest_K, wrong.sd_K};
}

void Suspicion::begin(const Suspect& suspect, nanoseconds since) noexcept {
  const std::size_t sensor = suspect.sensor;
  const std::size_t input = suspect.input;
  if (state_.suspected[sensor] != 0) return;  // already suspected as a sensor of another input
  // Earlier errors were measured with this sensor as a neighbour: removes its share.
  for (std::size_t other = 0; other < inputs_.size(); ++other) {
    if (other == input) continue;
    for (const std::size_t earlier : inputs_[other]) {
      if (state_.suspected[earlier] == 0 || unsuspected_sensors(other) > 0) continue;
      for (std::size_t i = 0; i < inputs_.size(); ++i)
        errors_K_[i] = unsuspected_sensors(i) > 0 ? 0.0 : not_a_number;
      errors_K_[input] = suspect.size_K / static_cast<double>(unsuspected_sensors(input));
      errors_K_[other] = 0.0;
      const double taken_K = check_.remainder_K(other, errors_K_);
      if (std::isfinite(taken_K)) state_.size_K[earlier] -= taken_K;
    }
  }
  ++state_.count;
  state_.suspected[sensor] = 1;
  state_.size_K[sensor] = state_.found_K[sensor] = suspect.size_K;
  state_.since[sensor] = since;
  state_.agreed_ticks[sensor] = 0;
  state_.missing_ticks[sensor] = 0;
  if (!may_weigh_down_) return;
  state_.weighed_down[sensor] = 1;
  correct(sensor, suspect.sd_K);
}

std::size_t Suspicion::unsuspected_sensors(std::size_t input) const noexcept {
  std::size_t count = 0;
  for (const std::size_t sensor : inputs_[input])
    if (state_.suspected[sensor] == 0) ++count;
  return count;
}

/// Each input of the sensor without its error, at the newest tick.
void Suspicion::correct(std::size_t sensor, double sd_K) noexcept {
  for (std::size_t input = 0; input < inputs_.size(); ++input) {
    const std::vector<std::size_t>& sensors = inputs_[input];
    if (std::find(sensors.begin(), sensors.end(), sensor) == sensors.end()) continue;
    double sum_degC = 0.0;
    std::size_t count = 0;
    for (const std::size_t each : sensors) {
      if (each != sensor && state_.weighed_down[each] != 0) continue;
      const double value_degC = tick(each, 0) - (each == sensor ? state_.size_K[sensor] : 0.0);
      if (!std::isfinite(value_degC)) continue;
      sum_degC += value_degC;
      ++count;
    }
    if (count == 0 || corrected_count_ == corrected_.size()) continue;
    const auto of = static_cast<double>(count);
    corrected_[corrected_count_++] = {input, sum_degC / of, sd_K / of};
  }
}

void Suspicion::follow_suspected() noexcept {
  if (state_.count == 0) return;
  for (std::size_t i = 0; i < names_.size(); ++i) changes_K_[i] = tick(i, 0) - tick(i, 1);
  for (std::size_t i = 0; i < names_.size(); ++i)
    if (state_.suspected[i] != 0) follow(i);
}

std::size_t Suspicion::input_of(std::size_t sensor) const noexcept {
  const auto of = std::find_if(inputs_.begin(), inputs_.end(), [sensor](const auto& sensors) {
    return std::find(sensors.begin(), sensors.end(), sensor) != sensors.end();
  });
  return static_cast<std::size_t>(of - inputs_.begin());
}

void Suspicion::follow(std::size_t sensor) noexcept {
  const bool missing = !std::isfinite(tick(sensor, 0));
  state_.missing_ticks[sensor] = missing ? state_.missing_ticks[sensor] + 1 : 0;
  if (state_.missing_ticks[sensor] >= over_ticks) return end(sensor);
  const std::size_t input = input_of(sensor);
  join_changes();
  double expected_K = input_changes_K_[input];
  if (!std::isfinite(expected_K)) {
    input_changes_K_[input] = changes_K_[sensor];
    expected_K = changes_K_[sensor] - check_.remainder_K(input, input_changes_K_);
  }
  const double grown_K = changes_K_[sensor] - expected_K;
  if (std::isfinite(grown_K)) state_.size_K[sensor] += grown_K;
  const bool agrees =
      !missing && std::abs(state_.size_K[sensor]) <= over_share * std::abs(state_.found_K[sensor]);
  state_.agreed_ticks[sensor] = agrees ? state_.agreed_ticks[sensor] + 1 : 0;
  if (state_.agreed_ticks[sensor] >= over_ticks) end(sensor);
}

void Suspicion::end(std::size_t sensor) noexcept {
  --state_.count;
  state_.suspected[sensor] = 0;
  state_.weighed_down[sensor] = 0;
  forget(sensor);
}

void Suspicion::forget(std::size_t sensor) noexcept {
  for (std::size_t i = 0; i < ticks_kept; ++i)
    state_.ticks_K[sensor * ticks_kept + i] = not_a_number;
  for (std::size_t i = 0; i < levels_kept; ++i)
    state_.levels_K[sensor * levels_kept + i] = not_a_number;
}

void Suspicion::use_all() noexcept {
  std::fill(state_.weighed_down.begin(), state_.weighed_down.end(), std::uint8_t{0});
}

void Suspicion::restart() noexcept {
  for (std::size_t i = 0; i < names_.size(); ++i)
    if (state_.suspected[i] != 0) end(i);
}

void Suspicion::report(std::span<SensorReport> sensors) const noexcept {
  for (std::size_t i = 0; i < names_.size(); ++i) {
    sensors[i].suspected = state_.suspected[i] != 0;
    sensors[i].weighed_down = state_.weighed_down[i] != 0;
    sensors[i].suspected_size_K = state_.size_K[i];
    sensors[i].suspected_since = state_.since[i];
  }
}

void Suspicion::plan_adoption(const Suspicion& previous) {
  sensor_plan_.assign(names_.size(), -1);
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const auto found = std::find(previous.names_.begin(), previous.names_.end(), names_[i]);
    const auto from = static_cast<std::size_t>(found - previous.names_.begin());
    if (found != previous.names_.end() && previous.references_[from] == references_[i])
      sensor_plan_[i] = static_cast<int>(from);
  }
}

void Suspicion::adopt(const Suspicion& previous) noexcept {
  const State& other = previous.state_;
  state_.started = other.started;
  state_.next_look = other.next_look;
  state_.last_look = other.last_look;
  state_.tick_begin = other.tick_begin;
  state_.looked = other.looked;
  state_.ticks_since_level = other.ticks_since_level;
  state_.next_tick = other.next_tick;
  state_.next_level = other.next_level;
  const auto copy = [](const std::vector<double>& theirs, std::size_t from,
                       std::vector<double>& ours, std::size_t to, std::size_t count) {
    std::copy_n(theirs.begin() + static_cast<std::ptrdiff_t>(from * count), count,
                ours.begin() + static_cast<std::ptrdiff_t>(to * count));
  };
  for (std::size_t i = 0; i < names_.size(); ++i) {
    if (sensor_plan_[i] < 0) continue;
    const auto from = static_cast<std::size_t>(sensor_plan_[i]);
    copy(other.looked_K, from, state_.looked_K, i, looks);
    copy(other.ticks_K, from, state_.ticks_K, i, ticks_kept);
    copy(other.levels_K, from, state_.levels_K, i, levels_kept);
    state_.suspected[i] = input_of(i) < inputs_.size() ? other.suspected[from] : std::uint8_t{0};
    state_.weighed_down[i] =
        may_weigh_down_ && state_.suspected[i] != 0 ? other.weighed_down[from] : std::uint8_t{0};
    state_.size_K[i] = other.size_K[from];
    state_.found_K[i] = other.found_K[from];
    state_.since[i] = other.since[from];
    state_.agreed_ticks[i] = other.agreed_ticks[from];
    state_.missing_ticks[i] = other.missing_ticks[from];
    state_.creep_ticks[i] = other.creep_ticks[from];
  }
  state_.count = static_cast<std::size_t>(
      std::count(state_.suspected.begin(), state_.suspected.end(), std::uint8_t{1}));
}

}  // namespace thermocomp
