#include "invariants.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace thermocomp::faults {

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
      // Serial answers have no transaction number: one to the same request may be up to 3 s old.
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
    // An axis that has sent nothing keeps the allowance of its last start.
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
    // An offset computed with the previous rate may still be in transit.
    rate_um_per_s_[i] = std::max(rate_um_per_s_[i], limiter.rate_um_per_s_max);
  }
}

void Invariants::restored(const PersistentState& saved, const Report& report,
                          const std::vector<std::string>& columns, nanoseconds now) {
  note_learned(report);
  for (std::size_t axis = 0; axis < axes_count; ++axis) {
    const std::string name(1, static_cast<char>('x' + axis));
    auto learned = RunningCorrection::persistent(report.axes[axis].correction);
    learned["probed_um"] = report.axes[axis].last_probing.without_offset_um;
    learned["probed_model_um"] = report.axes[axis].last_probing.model_um;
    for (const auto& [key, value] : saved.correction) {
      // A restored standard deviation may be larger: drift was added.
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
    demand(input_of(column).reference_degC == reference_degC, "state_survives_restart", now,
           [&, column = column, reference_degC = reference_degC] {
             return fmt::format("reference of {}: {:.3f} degC, {:.3f} was saved", column,
                                input_of(column).reference_degC, reference_degC);
           });
  for (std::size_t axis = 0; axis < axes_count; ++axis) {
    offset_um_[axis] = report.axes[axis].offset_um;
    const auto found = saved.offset_um.find(std::string(1, static_cast<char>('x' + axis)));
    // An offset beyond the bound is not restored; without read-back a newer record may exist.
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

void Invariants::check_command(const CycleSeen& seen) {
  const double dt_s = first_ ? 0.0 : std::min(to_s(seen.now - last_), 1.0);
  for (std::size_t i = 0; i < axes_count; ++i) {
    const double offset_um = seen.command->offset_um[i];
    demand(std::isfinite(offset_um), "only_finite_numbers", seen.now, "offset");
    const LimiterConfig& limiter = seen.shape->estimator.axes[i].limiter;
    const double step_um = limiter.rate_um_per_s_max * dt_s + tiny_um;
    const double reported_um = seen.reported->applied_um[i];
    const bool from_applied =
        std::abs(reported_um) <= largest_bound_um_[i] + register_rounding_um &&
        std::abs(offset_um - reported_um) <= step_um + register_rounding_um;
    double bound_um = std::max(limiter.offset_um_max, std::abs(offset_um_[i]));
    if (from_applied) bound_um = std::max(bound_um, std::abs(reported_um));
    demand(std::abs(offset_um) <= bound_um + tiny_um, "offset_within_bound", seen.now,
           [&] { return fmt::format("axis {}: {:.4f} um beside {:.4f}", i, offset_um, bound_um); });
    demand(std::abs(offset_um - offset_um_[i]) <= step_um || from_applied || is_released(seen, i),
           "slew_kept_by_command", seen.now, [&] {
             return fmt::format("axis {}: from {:.4f} to {:.4f} um in {:.3f} s, applied {:.4f}", i,
                                offset_um_[i], offset_um, dt_s, reported_um);
           });
  }
}

/// Not driven, with an initial offset of zero. A driven axis starts at zero only after an operator
/// has set it to zero, until a value has been sent.
bool Invariants::is_released(const CycleSeen& seen, std::size_t axis) const {
  const double step_um = rate_um_per_s_[axis] * period_s_ + tiny_um;
  return !reads_back_ && std::abs(seen.command->offset_um[axis]) <= step_um &&
         !offset_was_driven_[axis] &&
         (!seen.command->valid[axis] || seen.report->axes[axis].start == StartEvidence::released);
}

void Invariants::check_hold(const CycleSeen& seen) {
  const CompensationConfig& policy = seen.shape->estimator.compensation;
  const Report& report = *seen.report;
  // With a covariance, lost blocks are estimated.
  const bool lost = seen.shape->model.covariance_K2.empty() && any_block_lost(seen.now);
  check_suspicion(report, seen.now);
  const bool twice = lost && lost_before_;
  lost_before_ = lost;
  demand(!lost || report.mode != Mode::compensating, "no_offset_from_invalid_model", seen.now,
         "compensating although a block has no reading");
  if (report.mode == Mode::compensating) last_compensating_ = seen.now;
  const bool disabled = report.mode == Mode::disabled;
  const bool cutting = seen.reported->online && seen.reported->signals[0] >= 0.5;
  const bool proving = std::any_of(report.axes.begin(), report.axes.end(),
                                   [](const AxisReport& axis) { return axis.proving; });
  if (first_ || disabled || proving) return;
  const double held_s = to_s(seen.now - last_compensating_);
  for (std::size_t i = 0; i < axes_count; ++i) {
    const double change_um = seen.command->offset_um[i] - offset_um_[i];
    const double rate_um = seen.shape->estimator.axes[i].limiter.rate_um_per_s_max;
    const bool from_applied = std::abs(seen.command->offset_um[i] - seen.reported->applied_um[i]) <=
                              rate_um + register_rounding_um;
    if (is_released(seen, i)) continue;
    if (change_um == 0.0 || (from_applied && report.axes[i].disagrees)) continue;
    const double bound_um = seen.shape->estimator.axes[i].limiter.offset_um_max;
    const bool beyond_new_bound =
        std::max(std::abs(offset_um_[i]), std::abs(seen.reported->applied_um[i])) > bound_um &&
        std::abs(seen.command->offset_um[i]) >= bound_um - tiny_um;
    if (beyond_new_bound) continue;
    const bool resynced = from_applied && !twice;
    if (cutting && policy.hold_while_cutting && !from_applied)
      demand(false, "hold_policy_kept", seen.now, fmt::format("axis {} moves mid-cut", i));
    if (!twice || resynced) continue;
    const bool may_ramp = policy.on_loss == LossPolicy::ramp_to_zero && held_s >= policy.hold_s;
    const bool inwards = std::abs(seen.command->offset_um[i]) < std::abs(offset_um_[i]);
    // A new epoch starts from the read-back.
    const bool at_applied = std::abs(seen.command->offset_um[i] - seen.reported->applied_um[i]) <=
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

/// Checks corrections from probings and the values held between cycle ends.
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

/// A travel node's displacement is the model's with the slide at the node, wherever the slide is.
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
  if (referenced_) return;  // the bias belonged to the previous reference
  const double allowed_um = config.step_um_max * static_cast<double>(probings_[axis]) + 1e-6;
  // The contributions are known only if displacement was predicted.
  if (learned_[axis].predicted && !first_)
    demand(std::abs(change_um) <= allowed_um, "probing_step_bounded", seen.now, [&] {
      return fmt::format("axis {}: the estimate moves by {:.4f} um, {:.4f} allowed", axis,
                         change_um, allowed_um);
    });
  const bool cutting = seen.reported->online && seen.reported->signals[0] >= 0.5;
  demand(!cutting || !used_changed, "nothing_learned_mid_cut", seen.now,
         [&] { return fmt::format("axis {}: its gains change while cutting", axis); });
}

void Invariants::check_cycle_hold(const CycleSeen& seen) {
  const std::vector<InputReport>& inputs = seen.report->inputs;
  bool same = held_degC_.size() == inputs.size();
  for (std::size_t i = 0; same && i < inputs.size(); ++i)
    same = inputs[i].held_degC == held_degC_[i] ||
           (std::isnan(inputs[i].held_degC) && std::isnan(held_degC_[i]));
  // A new reference resets the held temperatures.
  const bool may_change = seen.report->cycle_ends > ends_at_hold_ || referenced_ || first_;
  demand(same || may_change, "held_between_cycle_ends", seen.now,
         [] { return std::string("the held temperatures change without a cycle end"); });
  // The first cycle has no previous held values.
  if (!same && !referenced_ && !first_) ends_at_hold_ = seen.report->cycle_ends;
}

/// Temperatures are held: their displacement uses the current matrix and gains.
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
  const nanoseconds begun =
      std::max({schedule_.fault_free_since(seen.now), boot_, switched_off_last_});
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

/// Allowed time: patience and turn of the link, and the cycles until it is reported.
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

}  // namespace thermocomp::faults
