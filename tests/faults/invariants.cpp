#include "invariants.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace thermocomp::faults {
namespace {

const std::array<std::vector<std::size_t>, 3> blocks{{{0, 4}, {1, 2}, {3, 5, 6}}};

constexpr double tiny_um = 1e-9;
/// What was sent so long ago does not explain a read-back any more [s].
constexpr double window_s = 10.0;
/// The window of comparison, and the read-back and the command that are under way at its end.
constexpr nanoseconds settling = std::chrono::seconds(8);

nanoseconds from_s(double time_s) {
  return nanoseconds{static_cast<nanoseconds::rep>(time_s * 1e9)};
}
double to_s(nanoseconds time) {
  return 1e-9 * static_cast<double>(time.count());
}

}  // namespace

std::array<double, 2> contributions_um(const MachineShape& shape, const Report& report,
                                       std::size_t axis) {
  std::array<double, 3> part_um{};
  for (std::size_t k = 0; k < part_um.size(); ++k)
    part_um[k] = shape.model.matrix_um_per_K[axis][k] *
                 (report.inputs[k].temp_degC - report.inputs[k].reference_degC);
  return {part_um[0], part_um[1] + part_um[2]};
}

Invariants::Invariants(const MachineShape& shape, const FaultSchedule& schedule,
                       const Thermocouples& thermocouples)
    : schedule_(schedule), thermocouples_(thermocouples) {
  for (const UnitPlace& place : unit_places()) {
    const double timeout_s = 1e-3 * shape.buses[place.bus].line.timeout_ms;
    for (const std::size_t sensor : place.sensors) {
      // A serial answer carries no number: one to the same question may be up to 3 s old.
      slack_[sensor] = from_s(timeout_s + (place.bus == 0 ? 0.05 : 3.1));
      const ScreeningConfig& screening = shape.estimator.sensors[sensor].screening;
      stale_after_[sensor] = from_s(screening.stale_after_s);
      settled_after_[sensor] = from_s(screening.settle_s);
      stamped_earlier_[sensor] = place.has_counter || place.has_status;
    }
  }
  link_period_s_ = shape.controller.period_s;
  link_timeout_s_ = 1e-3 * shape.controller.line.timeout_ms;
  turn_s_ = 2.0 * (1.0 + shape.controller.line.retries) * (link_timeout_s_ + 0.05);
  patience_s_ = std::max({5.0 * link_period_s_, 1.0, 2.0 * turn_s_});
  smoothing_off_ = shape.estimator.sensors[0].smoothing.form == SmoothingForm::off;
  resolution_um_ = shape.offsets_are_float ? 1e-4 : 0.1;
  reads_back_ = shape.estimator.controller_reads_back;
  wanted_um_.fill(not_a_number);
  for (std::size_t i = 0; i < axes_count; ++i) {
    largest_bound_um_[i] = bound_um_[i] = shape.estimator.axes[i].limiter.offset_um_max;
    rate_um_per_s_[i] = shape.estimator.axes[i].limiter.rate_um_per_s_max;
  }
}

void Invariants::booted(nanoseconds now, double leap_um) {
  boot_ = now;
  for (std::size_t i = 0; i < axes_count; ++i) {
    // What a start before this one went by still holds where it has sent nothing.
    leap_um_[i] = has_moved_[i] ? leap_um : std::max(leap_um_[i], leap_um);
  }
  wanted_before_um_ = wanted_um_;
  has_moved_.fill(false);
  sent_ = {};
  last_ = now;
  last_compensating_ = now;
  first_ = true;
  lost_before_ = false;
  last_readings_ = {};
  last_used_.fill(now);
  first_used_.fill(nanoseconds{-1});
  true_at_.fill(now);
  had_truth_.fill(false);
  probings_ = {};
  referenced_ = false;
  learned_ = {};
  for (Learned& learned : learned_) {
    learned.correction.gain.fill(1.0);
    learned.correction.gain_used.fill(1.0);
  }
  held_degC_.clear();
  ends_at_hold_ = 0;
}

void Invariants::reloaded(const MachineShape& shape) {
  for (std::size_t i = 0; i < axes_count; ++i) {
    const LimiterConfig& limiter = shape.estimator.axes[i].limiter;
    bound_um_[i] = limiter.offset_um_max;
    largest_bound_um_[i] = std::max(largest_bound_um_[i], limiter.offset_um_max);
    // What was computed before may still be under way.
    rate_um_per_s_[i] = std::max(rate_um_per_s_[i], limiter.rate_um_per_s_max);
  }
}

void Invariants::restored(const PersistentState& saved, const Report& report,
                          const std::vector<std::string>& columns, nanoseconds now) {
  note_learned(report);
  for (std::size_t axis = 0; axis < axes_count; ++axis) {
    const std::string name(1, static_cast<char>('x' + axis));
    const auto learned = RunningCorrection::persistent(report.axes[axis].correction);
    for (const auto& [key, value] : saved.correction) {
      // An uncertainty may be greater than before: drift has been added to it.
      if (!key.starts_with(name + ".") || key.ends_with("_sd")) continue;
      const auto found = learned.find(key.substr(name.size() + 1));
      demand(found != learned.end() && found->second == value, "state_survives_restart", now,
             "correction " + key);
    }
  }
  const auto input_of = [&](const std::string& column) {
    const auto found = std::find(columns.begin(), columns.end(), column);
    return found == columns.end()
               ? InputReport{}
               : report.inputs[static_cast<std::size_t>(found - columns.begin())];
  };
  for (const auto& [column, held_degC] : saved.held_degC)
    demand(input_of(column).held_degC == held_degC, "state_survives_restart", now,
           "held temperature of " + column);
  demand(report.enabled == saved.enabled, "state_survives_restart", now, "the operator's switch");
  for (const auto& [column, reference_degC] : saved.reference_degC)
    demand(input_of(column).reference_degC == reference_degC, "state_survives_restart", now, [&] {
      return fmt::format("reference of {}: {:.3f} degC, {:.3f} was saved", column,
                         input_of(column).reference_degC, reference_degC);
    });
  for (std::size_t axis = 0; axis < axes_count; ++axis) {
    offset_um_[axis] = report.axes[axis].offset_um;
    const auto found = saved.offset_um.find(std::string(1, static_cast<char>('x' + axis)));
    // Of an earlier, larger bound it is not taken; of a record there is a later one.
    demand(found == saved.offset_um.end() || found->second == offset_um_[axis] || !reads_back_ ||
               std::abs(found->second) > bound_um_[axis],
           "state_survives_restart", now, "offset of an axis");
  }
}

void Invariants::check(const CycleSeen& seen, std::vector<Move>& moves,
                       SimulatedController& controller) {
  check_readings(seen);
  check_sensors_used(seen);
  check_truth(seen);
  for (const Move& move : moves) {
    check_move(seen, move, controller);
    check_sent(seen, move);
    if (!reads_back_ && !std::exchange(has_moved_[move.axis], true)) check_first(seen, move);
    is_lost_[move.axis] = false;
  }
  moves.clear();
  for (std::size_t axis = 0; axis < axes_count; ++axis) check_unexplained(seen, axis);
  check_hold(seen);
  check_command(seen);
  check_recovery(seen, controller);
  check_written(seen, controller);
  check_correction(seen);
  for (std::size_t i = 0; i < axes_count; ++i) {
    offset_um_[i] = seen.command->offset_um[i];
    offset_was_driven_[i] = seen.command->valid[i];
    if (seen.command->valid[i] || seen.report->axes[i].start == StartEvidence::released)
      wanted_um_[i] = seen.command->offset_um[i];
  }
  last_ = seen.now;
  first_ = false;
}

void Invariants::check_readings(const CycleSeen& seen) {
  for (std::size_t i = 0; i < sensors_count; ++i) {
    const Reading& reading = seen.readings[i];
    Reading& before = last_readings_[i];
    const bool new_one = reading.taken_at != before.taken_at ||
                         reading.temp_degC != before.temp_degC || reading.fault != before.fault;
    if (!new_one) continue;
    before = reading;
    // What no thermocouple can be is the screening's to refuse.
    const bool believable = std::abs(reading.temp_degC) < 200.0 && reading.temp_degC > -30.0;
    if (reading.fault != Fault::none || !(believable || std::isnan(reading.temp_degC))) continue;
    demand(reading.taken_at <= seen.now, "reading_is_what_was_given", seen.now, [&] {
      return fmt::format("sensor {}: taken {:.3f} s ahead of the cycle", i + 1,
                         to_s(reading.taken_at - seen.now));
    });
    const nanoseconds to = stamped_earlier_[i] ? seen.now : reading.taken_at;
    const Sample* sample =
        thermocouples_.given(i, reading.temp_degC, reading.taken_at - slack_of(i), to);
    if (sample != nullptr) continue;
    demand(false, "reading_is_what_was_given", seen.now,
           fmt::format("sensor {}: {:.6f} degC, said to be of {:.3f} s before the cycle", i + 1,
                       reading.temp_degC, to_s(seen.now - reading.taken_at)));
  }
}

bool Invariants::fresh(std::size_t sensor, nanoseconds now) const {
  const nanoseconds given_at = thermocouples_.last_good(sensor);
  return given_at >= nanoseconds{0} && now - given_at <= stale_after_[sensor] + slack_of(sensor);
}

/// As long as every block has a sensor that is not faulted, no suspicion ends the compensation.
void Invariants::check_suspicion(const Report& report, nanoseconds now) {
  const bool all_there = std::all_of(blocks.begin(), blocks.end(), [&](const auto& block) {
    return std::any_of(block.begin(), block.end(), [&](std::size_t sensor) {
      return report.sensors[sensor].fault == Fault::none;
    });
  });
  const bool doubted = std::any_of(report.sensors.begin(), report.sensors.end(),
                                   [](const SensorReport& each) { return each.suspected; });
  demand(!(doubted && all_there && has_reason(report.reasons, Reason::block_lost)),
         "suspicion_never_holds", now,
         "a block without a sensor, though each has one that is good");
}

bool Invariants::any_block_lost(nanoseconds now) const {
  return std::any_of(blocks.begin(), blocks.end(), [&](const std::vector<std::size_t>& block) {
    return std::none_of(block.begin(), block.end(),
                        [&](std::size_t sensor) { return fresh(sensor, now); });
  });
}

void Invariants::check_sensors_used(const CycleSeen& seen) {
  for (std::size_t i = 0; i < sensors_count; ++i) {
    const SensorReport& sensor = seen.report->sensors[i];
    if (sensor.fault != Fault::none) continue;
    demand(fresh(i, seen.now), "no_stale_reading_used", seen.now, [&] {
      return fmt::format("sensor {}: last given out {:.3f} s ago", i + 1,
                         to_s(seen.now - thermocouples_.last_good(i)));
    });
    if (!smoothing_off_ || broken_) continue;
    const Sample* sample = thermocouples_.given(i, sensor.smoothed_degC,
                                                seen.now - stale_after_[i] - slack_of(i), seen.now);
    if (sample == nullptr) {
      demand(false, "no_faulty_reading_used", seen.now,
             fmt::format("sensor {}: {:.4f} degC was not given out of late", i + 1,
                         sensor.smoothed_degC));
      return;
    }
    constexpr double believable_after_s = 90.0;
    // The very first value has nothing to be compared with; the second may not leave it standing.
    if (first_used_[i] < nanoseconds{0}) first_used_[i] = seen.now;
    const bool first = to_s(seen.now - first_used_[i]) < 4.0;
    if (sample->impossible && !first && to_s(seen.now - last_used_[i]) < believable_after_s)
      demand(false, "no_faulty_reading_used", seen.now,
             fmt::format("sensor {}: a spike of {:.2f} degC is used", i + 1, sensor.smoothed_degC));
    if (!sample->impossible || !first) last_used_[i] = seen.now;
  }
}

/// A daemon that starts beside a false reading has no past to tell it by; what it read while the
/// sensor settled is none.
void Invariants::check_truth(const CycleSeen& seen) {
  for (std::size_t i = 0; i < sensors_count; ++i) {
    const SensorReport& sensor = seen.report->sensors[i];
    const double off_K =
        std::abs(sensor.smoothed_degC - thermocouples_.plausible_degC(i, seen.now));
    const bool is_settled = seen.now - boot_ > settled_after_[i];
    if (sensor.fault == Fault::none && off_K <= false_K_max && is_settled) had_truth_[i] = true;
    if (sensor.fault != Fault::none || !(off_K > false_K_max) || !had_truth_[i])
      true_at_[i] = seen.now;
    demand(to_s(seen.now - true_at_[i]) <= false_s_max, "no_false_reading_used", seen.now, [&] {
      return fmt::format("sensor {}: {:.2f} degC is used, {:.2f} K off the machine, for {:.0f} s",
                         i + 1, sensor.smoothed_degC, off_K, to_s(seen.now - true_at_[i]));
    });
  }
}

void Invariants::check_command(const CycleSeen& seen) {
  const double dt_s = first_ ? 0.0 : std::min(to_s(seen.now - last_), 1.0);
  for (std::size_t i = 0; i < axes_count; ++i) {
    const double offset_um = seen.command->offset_um[i];
    demand(std::isfinite(offset_um), "only_finite_numbers", seen.now, "offset");
    const LimiterConfig& limiter = seen.shape->estimator.axes[i].limiter;
    const double step_um = limiter.rate_um_per_s_max * dt_s + tiny_um;
    const double told_um = seen.told->applied_um[i];
    const bool from_applied = std::abs(told_um) <= largest_bound_um_[i] + register_rounding_um &&
                              std::abs(offset_um - told_um) <= step_um + register_rounding_um;
    double bound_um = std::max(limiter.offset_um_max, std::abs(offset_um_[i]));
    if (from_applied) bound_um = std::max(bound_um, std::abs(told_um));
    demand(std::abs(offset_um) <= bound_um + tiny_um, "offset_within_bound", seen.now,
           [&] { return fmt::format("axis {}: {:.4f} um beside {:.4f}", i, offset_um, bound_um); });
    demand(std::abs(offset_um - offset_um_[i]) <= step_um || from_applied || is_released(seen, i),
           "slew_kept_by_command", seen.now, [&] {
             return fmt::format("axis {}: from {:.4f} to {:.4f} um in {:.3f} s, applied {:.4f}", i,
                                offset_um_[i], offset_um, dt_s, told_um);
           });
  }
}

/// Not driven: what would be sent first is zero. A driven axis goes there only where an operator
/// has set it to zero, and nothing has been sent since.
bool Invariants::is_released(const CycleSeen& seen, std::size_t axis) const {
  const double step_um = rate_um_per_s_[axis] * period_s_ + tiny_um;
  return !reads_back_ && std::abs(seen.command->offset_um[axis]) <= step_um &&
         !offset_was_driven_[axis] &&
         (!seen.command->valid[axis] || seen.report->axes[axis].start == StartEvidence::released);
}

void Invariants::check_hold(const CycleSeen& seen) {
  const CompensationConfig& policy = seen.shape->estimator.compensation;
  const Report& report = *seen.report;
  // With a covariance a lost block is estimated.
  const bool lost = seen.shape->model.covariance_K2.empty() && any_block_lost(seen.now);
  check_suspicion(report, seen.now);
  const bool twice = lost && lost_before_;
  lost_before_ = lost;
  demand(!lost || report.mode != Mode::compensating, "no_offset_from_invalid_model", seen.now,
         "compensating although a block has no reading");
  if (report.mode == Mode::compensating) last_compensating_ = seen.now;
  const bool disabled = report.mode == Mode::disabled;
  const bool cutting = seen.told->online && seen.told->signals[0] >= 0.5;
  const bool proving = std::any_of(report.axes.begin(), report.axes.end(),
                                   [](const AxisReport& axis) { return axis.proving; });
  if (first_ || disabled || proving) return;
  const double held_s = to_s(seen.now - last_compensating_);
  for (std::size_t i = 0; i < axes_count; ++i) {
    const double change_um = seen.command->offset_um[i] - offset_um_[i];
    const double rate_um = seen.shape->estimator.axes[i].limiter.rate_um_per_s_max;
    const bool from_applied = std::abs(seen.command->offset_um[i] - seen.told->applied_um[i]) <=
                              rate_um + register_rounding_um;
    if (is_released(seen, i)) continue;
    if (change_um == 0.0 || (from_applied && report.axes[i].disagrees)) continue;
    const double bound_um = seen.shape->estimator.axes[i].limiter.offset_um_max;
    const bool beyond_new_bound =
        std::max(std::abs(offset_um_[i]), std::abs(seen.told->applied_um[i])) > bound_um &&
        std::abs(seen.command->offset_um[i]) >= bound_um - tiny_um;
    if (beyond_new_bound) continue;
    const bool resynced = from_applied && !twice;
    if (cutting && policy.hold_while_cutting && !from_applied)
      demand(false, "hold_policy_kept", seen.now, fmt::format("axis {} moves mid-cut", i));
    if (!twice || resynced) continue;
    const bool may_ramp = policy.on_loss == LossPolicy::ramp_to_zero && held_s >= policy.hold_s;
    const bool inwards = std::abs(seen.command->offset_um[i]) < std::abs(offset_um_[i]);
    // At a new epoch the offset starts from the read-back.
    const bool at_applied = std::abs(seen.command->offset_um[i] - seen.told->applied_um[i]) <=
                            register_rounding_um + rate_um * (may_ramp && !cutting ? 1.0 : 0.0);
    demand(at_applied || (may_ramp && inwards && !cutting), "hold_policy_kept", seen.now, [&] {
      return fmt::format("axis {}: {:+.4f} um after {:.1f} s without data{}", i, change_um, held_s,
                         cutting ? ", mid-cut" : "");
    });
  }
}

void Invariants::note_learned(const Report& report) {
  for (std::size_t i = 0; i < axes_count; ++i) {
    learned_[i].correction = report.axes[i].correction;
    learned_[i].proving = report.axes[i].proving;
    learned_[i].predicted = report.mode == Mode::compensating;
  }
  held_degC_.clear();
  for (const InputReport& input : report.inputs) held_degC_.push_back(input.held_degC);
}

/// Probings and cycle ends.
void Invariants::check_correction(const CycleSeen& seen) {
  const MachineShape& shape = *seen.shape;
  const Report& report = *seen.report;
  check_cycle_hold(seen);
  for (std::size_t i = 0; i < axes_count; ++i) {
    if (shape.estimator.correction.form != CorrectionForm::off) check_learning(seen, i);
    check_held_displacement(seen, i);
    if (report.mode != Mode::compensating) continue;
    if (shape.estimator.axes[i].node) {
      check_node(seen, i);
      continue;
    }
    learned_[i].contribution_um = contributions_um(shape, report, i);
    const CorrectionReport& now = report.axes[i].correction;
    double expected_um = 0.0;
    if (shape.estimator.correction.form != CorrectionForm::off) {
      expected_um = now.bias_used_um;
      for (std::size_t g = 0; g < 2; ++g)
        expected_um += (now.gain_used[g] - 1.0) * learned_[i].contribution_um[g];
    }
    const double corrected_um = report.axes[i].displacement_um - report.displacement_um[i];
    demand(std::abs(corrected_um - expected_um) < 1e-6, "gains_within_bounds", seen.now, [&] {
      return fmt::format("axis {}: corrected by {:.6f} um, its gains say {:.6f}", i, corrected_um,
                         expected_um);
    });
  }
  note_learned(report);
  probings_ = {};
  referenced_ = false;
}

/// What a node of the travel is moved by is the model's with the slide there, wherever it stands.
void Invariants::check_node(const CycleSeen& seen, std::size_t axis) {
  const ThermalModel& model = seen.shape->model;
  const std::vector<double>& row =
      model.guideways.front().rows_um_per_K.at(seen.shape->estimator.axes[axis].output)[axis - 1];
  double expected_um = 0.0;
  for (std::size_t i = 0; i < row.size(); ++i) {
    const InputReport& input = seen.report->inputs[i];
    expected_um +=
        (model.matrix_um_per_K[1][i] + row[i]) * (input.temp_degC - input.reference_degC);
  }
  const double displacement_um = seen.report->axes[axis].displacement_um;
  demand(std::abs(displacement_um - expected_um) < 1e-6, "node_follows_its_rows", seen.now, [&] {
    return fmt::format("axis {}: {:.6f} um at its node, its rows say {:.6f}", axis, displacement_um,
                       expected_um);
  });
}

void Invariants::check_learning(const CycleSeen& seen, std::size_t axis) {
  const CorrectionConfig& config = seen.shape->estimator.correction;
  const CorrectionReport& now = seen.report->axes[axis].correction;
  const CorrectionReport& before = learned_[axis].correction;
  double change_um = now.bias_um - before.bias_um;
  bool used_changed = now.bias_used_um != before.bias_used_um;
  for (std::size_t g = 0; g < 2; ++g) {
    demand(now.gain[g] >= config.gain_min && now.gain[g] <= config.gain_max, "gains_within_bounds",
           seen.now,
           [&] { return fmt::format("axis {}: gain {} is {}", axis, g + 1, now.gain[g]); });
    change_um += (now.gain[g] - before.gain[g]) * learned_[axis].contribution_um[g];
    used_changed = used_changed || now.gain_used[g] != before.gain_used[g];
  }
  if (referenced_) return;  // the bias was one from the reference before
  const double allowed_um = config.step_um_max * static_cast<double>(probings_[axis]) + 1e-6;
  // Without a prediction it is not known here what the contributions were.
  if (learned_[axis].predicted && !first_)
    demand(std::abs(change_um) <= allowed_um, "probing_step_bounded", seen.now, [&] {
      return fmt::format("axis {}: the estimate moves by {:.4f} um, {:.4f} allowed", axis,
                         change_um, allowed_um);
    });
  const bool cutting = seen.told->online && seen.told->signals[0] >= 0.5;
  demand(!cutting || !used_changed, "nothing_learned_mid_cut", seen.now,
         [&] { return fmt::format("axis {}: its gains change while cutting", axis); });
}

void Invariants::check_cycle_hold(const CycleSeen& seen) {
  const std::vector<InputReport>& inputs = seen.report->inputs;
  bool same = held_degC_.size() == inputs.size();
  for (std::size_t i = 0; same && i < inputs.size(); ++i)
    same = inputs[i].held_degC == held_degC_[i] ||
           (std::isnan(inputs[i].held_degC) && std::isnan(held_degC_[i]));
  // A new reference is a new beginning.
  const bool may_change = seen.report->cycle_ends > ends_at_hold_ || referenced_ || first_;
  demand(same || may_change, "held_between_cycle_ends", seen.now,
         [] { return std::string("the held temperatures change without a cycle end"); });
  // In the first cycle there is nothing yet that could have been held.
  if (!same && !referenced_ && !first_) ends_at_hold_ = seen.report->cycle_ends;
}

/// What is held are temperatures: the displacement is theirs, by the matrix and gains of now.
void Invariants::check_held_displacement(const CycleSeen& seen, std::size_t axis) {
  const MachineShape& shape = *seen.shape;
  const AxisReport& report = seen.report->axes[axis];
  const bool by_cycles = shape.estimator.compensation.update == UpdateRule::each_cycle &&
                         seen.report->mode == Mode::compensating && std::isfinite(report.held_um);
  if (!by_cycles) return;
  Report at_hold = *seen.report;
  double held_um = 0.0;
  for (std::size_t i = 0; i < at_hold.inputs.size(); ++i) {
    InputReport& input = at_hold.inputs[i];
    input.temp_degC = input.held_degC;
    held_um += shape.model.matrix_um_per_K[axis][i] * (input.held_degC - input.reference_degC);
  }
  if (shape.estimator.correction.form != CorrectionForm::off) {
    const std::array<double, 2> contribution_um = contributions_um(shape, at_hold, axis);
    held_um += report.correction.bias_used_um;
    for (std::size_t g = 0; g < 2; ++g)
      held_um += (report.correction.gain_used[g] - 1.0) * contribution_um[g];
  }
  demand(std::abs(report.held_um - held_um) < 1e-6, "held_between_cycle_ends", seen.now, [&] {
    return fmt::format("axis {}: {:.6f} um are held, its temperatures give {:.6f}", axis,
                       report.held_um, held_um);
  });
  if (report.proving || learned_[axis].proving || !report.driven) return;
  const double target_um = -shape.estimator.axes[axis].sign * report.held_um;
  demand(std::abs(report.target_um - target_um) < 1e-9, "held_between_cycle_ends", seen.now, [&] {
    return fmt::format("axis {}: heads for {:.4f} um, {:.4f} was held", axis, report.target_um,
                       target_um);
  });
}

void Invariants::check_recovery(const CycleSeen& seen, SimulatedController& controller) {
  if (controller.switched_off(seen.now)) switched_off_last_ = seen.now;
  const nanoseconds limit = from_s(recovery_s_max);
  const nanoseconds begun = std::max({schedule_.quiet_since(seen.now), boot_, switched_off_last_});
  const Episode* episode = schedule_.episode_at(seen.now);
  if (seen.now - begun < limit || (episode != nullptr && episode->begin <= seen.now)) return;
  demand(seen.report->mode == Mode::compensating, "recovered_in_time", seen.now, [&] {
    return fmt::format("{} {:.0f} s after the last fault's end, reasons {:#x}",
                       to_string(seen.report->mode), to_s(seen.now - begun), seen.report->reasons);
  });
  for (std::size_t i = 0; i < sensors_count; ++i) {
    const Fault fault = seen.report->sensors[i].fault;
    demand(fault == Fault::none, "recovered_in_time", seen.now,
           [&] { return fmt::format("sensor {} is still {}", i + 1, to_string(fault)); });
  }
}

/// Within the link's patience, and the turn and the cycles in which it comes to be known.
void Invariants::check_written(const CycleSeen& seen, const SimulatedController& controller) {
  const double allowed_s = patience_s_ + turn_s_ + 3.0 * period_s_;
  const double since_s = to_s(seen.now - controller.written_at());
  demand(seen.report->mode != Mode::compensating || since_s <= allowed_s, "compensating_is_written",
         seen.now, [&] {
           return fmt::format("compensating, and the last write that was taken is {:.1f} s ago",
                              since_s);
         });
  const bool is_only_slow =
      schedule_.alone(FaultKind::controller_slow, seen.now, from_s(2.0 * allowed_s)) &&
      to_s(seen.now - boot_) > 2.0 * allowed_s;
  demand(!is_only_slow || since_s <= allowed_s, "slow_controller_is_written", seen.now,
         [&] { return fmt::format("nothing written for {:.1f} s", since_s); });
}

void Invariants::check_move(const CycleSeen& seen, const Move& move,
                            const SimulatedController& controller) {
  demand(std::isfinite(move.to_um), "only_finite_numbers", seen.now, "register of the controller");
  // In the time that answers are waited for a controller can restart: what is written was looked at
  // just before.
  // The rest of an answer that has begun may take as long again.
  const double looked_s_max = 2.0 * (link_timeout_s_ + std::min(link_timeout_s_, 0.7)) + 0.05;
  demand(to_s(move.at - move.looked_at) <= looked_s_max, "looked_before_written", seen.now, [&] {
    return fmt::format("axis {}: written {:.3f} s after the last look, {:.3f} allowed", move.axis,
                       to_s(move.at - move.looked_at), looked_s_max);
  });
  Budget& budget = budgets_[move.axis];
  const double rate_um = rate_um_per_s_[move.axis];
  const double stall_s = patience_s_ + 2.0 * period_s_;
  const double elapsed_s = to_s(move.at - budget.at);
  budget.um = std::min(budget.um + rate_um * elapsed_s, rate_um * stall_s);
  budget.at = move.at;
  const double change_um = std::abs(move.to_um - move.from_um);
  // Offsets move on the cycle's grid, writes come when the link has its turn: one cycle besides.
  const double since_seen_um = rate_um * to_s(move.at - move.seen_at);
  double allowed_um = (move.disturbed ? std::min(budget.um, since_seen_um) : budget.um) +
                      rate_um * period_s_ + 2.0 * resolution_um_ +
                      (has_moved_[move.axis] ? 0.0 : leap_um_[move.axis]);
  // An operator may have released an axis on the word of a controller that has stopped lying since.
  const bool lies = controller.lies(move.at) || controller.lies(move.at - from_s(4.0));
  if (move.disturbed || lies) budget.disturbed_at = move.at;
  if (move.at - budget.disturbed_at < settling) {
    // What lies among the offsets sent of late cannot be told from obedience.
    const auto end = budget.told_um.begin() +
                     static_cast<std::ptrdiff_t>(std::min<std::size_t>(budget.count, 16));
    const auto [low, high] = std::minmax_element(budget.told_um.begin(), end);
    allowed_um += 3.0 + 2.0 * resolution_um_ + (budget.count == 0 ? 0.0 : *high - *low);
  }
  const bool knowable =
      (!move.disturbed || move.seen) && (has_moved_[move.axis] || !is_lost_[move.axis]);
  if (knowable && !lies)
    demand(change_um <= allowed_um, "slew_kept_at_controller", seen.now, [&] {
      return fmt::format("axis {}: told {:.4f} um where {:.4f} is applied, {:.4f} allowed",
                         move.axis, move.to_um, move.from_um, allowed_um);
    });
  budget.um = std::max(0.0, budget.um - std::max(0.0, change_um - 2.0 * resolution_um_));
  if (move.disturbed) budget.um = rate_um * stall_s;  // a new start
  budget.told_um[budget.count++ % 16] = move.to_um;
  demand(std::abs(move.to_um) <= largest_bound_um_[move.axis] + register_rounding_um,
         "offset_within_bound", seen.now, [&] {
           return fmt::format("axis {}: the controller is told {:.4f} um", move.axis, move.to_um);
         });
}

/// Without read-back nothing moves before a write is confirmed: what is sent first is what the
/// registers held or, where they cannot be read, what was wanted last. An axis that is released
/// goes on from 0 while others are written.
void Invariants::check_first(const CycleSeen& seen, const Move& move) {
  const double rounding_um = 2.0 * resolution_um_ + tiny_um;
  const double slack_um =
      rounding_um + rate_um_per_s_[move.axis] * (2.0 * period_s_ + link_period_s_);
  const bool is_read = std::isfinite(seen.told->applied_um[move.axis]);
  const bool held = is_read && std::abs(move.to_um - move.from_um) <= slack_um;
  const double before_um = wanted_before_um_[move.axis];
  const bool wanted = std::abs(move.to_um - before_um) <= leap_um_[move.axis] + slack_um;
  const bool released = std::abs(move.to_um) <= slack_um &&
                        seen.report->axes[move.axis].start == StartEvidence::released;
  demand(held || wanted || released || std::isnan(before_um) || is_lost_[move.axis],
         "first_offset_is_known", seen.now, [&] {
           return fmt::format("axis {}: {:.4f} um first, {:.4f} um last, {:.4f} allowed", move.axis,
                              move.to_um, before_um, leap_um_[move.axis]);
         });
}

/// Two values sent one after the other differ by no more than the slew allows, whatever was read
/// back between them. A link that is new begins from what is applied: between zero and what was
/// sent lately.
void Invariants::check_sent(const CycleSeen& seen, const Move& move) {
  Sent& sent = sent_[move.axis];
  const double rate_um_per_s = rate_um_per_s_[move.axis];
  const double elapsed_s = to_s(move.at - sent.at);
  const double stall_s = patience_s_ + 2.0 * period_s_;
  const double stall_um = rate_um_per_s * stall_s;
  const bool first = std::isnan(sent.um);
  const double change_um = first ? 0.0 : std::abs(move.to_um - sent.um);
  sent.credit_um = std::min(sent.credit_um + rate_um_per_s * elapsed_s,
                            std::max(stall_um, rate_um_per_s * elapsed_s + stall_um));
  const bool kept = change_um <= sent.credit_um + 2.0 * resolution_um_ + tiny_um;
  if (kept || move.breaks == sent.breaks) {
    demand(kept, "slew_kept_by_what_is_sent", seen.now, [&] {
      return fmt::format("axis {}: {:.4f} um after {:.4f} um, {:.3f} s apart, {:.4f} allowed",
                         move.axis, move.to_um, sent.um, elapsed_s, sent.credit_um);
    });
  } else {
    const auto [low_um, high_um] = sent.range_um(0.0);
    const double slack_um = 4.0 + stall_um + 2.0 * resolution_um_;
    demand(move.to_um >= low_um - slack_um && move.to_um <= high_um + slack_um,
           "slew_kept_by_what_is_sent", seen.now, [&] {
             return fmt::format("axis {}: {:.4f} um after {:.4f} um on a new link", move.axis,
                                move.to_um, sent.um);
           });
  }
  if (first || !kept) {
    sent.breaks = move.breaks;
    sent.credit_um = stall_um;
  }
  if (kept)
    sent.credit_um = std::max(0.0, sent.credit_um - std::max(0.0, change_um - resolution_um_));
  sent.um = move.to_um;
  sent.at = move.at;
  sent.lately.emplace_back(move.at, move.to_um);
  while (sent.lately.front().first < move.at - from_s(window_s)) sent.lately.pop_front();
}

std::pair<double, double> Invariants::Sent::range_um(double with_um) const {
  std::pair range{with_um, with_um};
  for (const auto& [at_time, value_um] : lately) {
    range.first = std::min(range.first, value_um);
    range.second = std::max(range.second, value_um);
  }
  return range;
}

/// Read-backs that nothing sent explains, one after the other: the axis is not driven.
void Invariants::check_unexplained(const CycleSeen& seen, std::size_t axis) {
  Sent& sent = sent_[axis];
  const double told_um = seen.told->applied_um[axis];
  const bool latched = seen.report->axes[axis].latched;
  demand(!latched || !seen.command->valid[axis], "unexplained_is_latched", seen.now,
         [&] { return fmt::format("axis {}: driven although latched", axis); });
  demand(latched || !sent.latched || sent.released, "unexplained_is_latched", seen.now,
         [&] { return fmt::format("axis {}: nobody released it", axis); });
  if (!latched) sent.released = false;
  sent.latched = latched;
  if (!reads_back_ || !seen.told->online || sent.lately.empty() || !std::isfinite(told_um)) return;
  // What the cycle wants explains a read-back as well as what reached the controller: after a
  // release or on a new link it starts from what is read back, and the write may be refused.
  const double wanted_um = seen.command->offset_um[axis];
  if (seen.command->valid[axis] &&
      (sent.wanted.empty() || seen.now - sent.wanted.back().first > from_s(0.5)))
    sent.wanted.emplace_back(seen.now, wanted_um);
  while (!sent.wanted.empty() && sent.wanted.front().first < seen.now - from_s(window_s))
    sent.wanted.pop_front();
  auto [low_um, high_um] = sent.range_um(wanted_um);
  for (const auto& [at, um] : sent.wanted) {
    low_um = std::min(low_um, um);
    high_um = std::max(high_um, um);
  }
  const double slack_um = seen.shape->estimator.compensation.mismatch_um + 2.0 +
                          rate_um_per_s_[axis] * (link_period_s_ + 2.0 * period_s_);
  const bool unexplained = told_um < low_um - slack_um || told_um > high_um + slack_um;
  // What has been latched, or was before a release, counts from here.
  const bool told = latched || has_reason(seen.report->reasons, Reason::applied_out_of_bound);
  if (!unexplained || told) sent.unexplained = 0;
  if (unexplained && !told && seen.told->taken_at != sent.read_back_at) ++sent.unexplained;
  sent.read_back_at = seen.told->taken_at;
  if (sent.unexplained < 5) return;
  demand(told, "unexplained_is_latched", seen.now, [&] {
    return fmt::format("axis {}: {:.4f} um is read back time and again, and nobody is told", axis,
                       told_um);
  });
  demand(!seen.command->valid[axis], "unexplained_is_latched", seen.now, [&] {
    return fmt::format("axis {}: driven at {:.4f} um although {:.4f} um is read back", axis,
                       seen.command->offset_um[axis], told_um);
  });
}

}  // namespace thermocomp::faults
