#include "estimator/pipeline/stages.hpp"

#include "estimator/checks.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/name_index.hpp"
#include "estimator/sensing/screening.hpp"

namespace thermocomp {
namespace {

const EstimatorConfig& checked(const EstimatorConfig& config, const ThermalModel& model) {
  config.compensation.validate();
  check_reference(config, model);
  // Refuses a broken model before a stage reads its rows.
  [[maybe_unused]] const DisplacementModel whole{model};
  return config;
}

std::vector<std::size_t> outputs_of_axes(const EstimatorConfig& config, const ThermalModel& model) {
  std::vector<std::size_t> outputs;
  for (const AxisConfig& axis : config.axes)
    outputs.push_back(
        index_of(model.outputs, axis.output, "axis.output", "is not an output of the model"));
  return outputs;
}

class ReasonSet {
 public:
  void add(bool holds, Reason reason) noexcept {
    if (holds) bits_ |= static_cast<std::uint32_t>(reason);
  }
  [[nodiscard]] std::uint32_t bits() const noexcept { return bits_; }

 private:
  std::uint32_t bits_{0};
};

/// Reasons of a step, a set of Reason, from the results of the stages.
/// @param written  see ControllerState
std::uint32_t reasons_of(const Signals& signals, bool written, const Temperatures& temps,
                         const ReferenceState& reference, const Displacement& displacement,
                         const ModeDecision::State& mode, const Targets& targets,
                         const AxisBank& axes) noexcept {
  ReasonSet reasons;
  reasons.add(!signals.online, Reason::controller_offline);
  reasons.add(!signals.complete, Reason::signal_lost);
  reasons.add(!reference.known, Reason::no_reference);
  reasons.add(displacement.block_lost, Reason::block_lost);
  reasons.add(displacement.block_estimated, Reason::block_estimated);
  reasons.add(temps.suspected, Reason::sensor_suspected);
  reasons.add(temps.jumped, Reason::sensor_unconfirmed);
  reasons.add(displacement.not_finite, Reason::no_target);
  reasons.add(displacement.outside, Reason::outside_domain);
  reasons.add(!mode.enabled, Reason::operator_disabled);
  reasons.add(signals.disable >= 0.5, Reason::controller_disabled);
  reasons.add(!targets.may_change || targets.waits_for_cut, Reason::cutting);
  for (const AxisChannel& axis : axes.all()) {
    // Nothing is sent for an axis that is not driven.
    reasons.add(signals.online && axis.driven() && !written, Reason::not_written);
    reasons.add(!axis.synced(), Reason::not_synced);
    reasons.add(axis.start_unknown(), Reason::start_unknown);
    reasons.add(axis.mismatch(), Reason::mismatch);
    reasons.add(axis.latched(), Reason::mismatch_latched);
    reasons.add(axis.at_bound(), Reason::at_bound);
    reasons.add(axis.out_of_bound(), Reason::applied_out_of_bound);
  }
  return reasons.bits();
}

}  // namespace

Stages::Stages(const EstimatorConfig& estimator_config, const ThermalModel& thermal_model)
    : config(checked(estimator_config, thermal_model)),
      model(of_axes(thermal_model)),
      axis_output(outputs_of_axes(config, model)),
      signals(config, model),
      sensing(config, model),
      reference(model),
      learned(config, model, axis_output),
      prediction(config, model, axis_output),
      mode(config.compensation),
      cycle_update(config, model, axis_output),
      targets(config),
      axes(config) {}

void Stages::step(nanoseconds now, std::span<const Reading> readings,
                  const ControllerState& controller, OffsetCommand& command) noexcept {
  THERMOCOMP_ENSURE(!record.stepped || now >= record.now);
  StepTime time{now, 0.0, !record.stepped};
  if (record.stepped) time.dt_s = to_seconds(now - record.now);

  const Signals controller_signals = signals.step(now, controller);
  Temperatures temps = sensing.step(now, readings);
  const ReferenceState reference_state = reference.step(now, temps, controller_signals);
  // A suspicion alone never ends the compensation.
  if (temps.weighed_down &&
      !prediction.would_serve(sensing.lost(), reference_state, controller_signals))
    temps = sensing.use_all(now);
  const Displacement displacement =
      prediction.step(now, temps, reference_state, controller_signals, sensing.lost(), learned);
  const Mode mode_now =
      mode.step({time, displacement.known, controller_signals.online, axes.synced(),
                 controller.written, controller_signals.disable >= 0.5});
  const std::span<const double> compensated_um =
      cycle_update.step(now, displacement, mode_now == Mode::compensating, temps, reference_state,
                        controller_signals, prediction.model(), learned);
  const Targets axis_targets =
      targets.step(mode_now, compensated_um, displacement, controller_signals);
  axes.step(time, axis_targets, controller_signals, controller, command);

  record = {record.cycle + 1,
            true,
            now,
            time.dt_s,
            displacement.known,
            reasons_of(controller_signals, controller.written, temps, reference_state, displacement,
                       mode.state(), axis_targets, axes)};
}

void Stages::plan_adoption(const Stages& previous) {
  sensing.plan_adoption(previous.sensing);
  plan.columns = plan_names(model.temperature_columns(), previous.model.temperature_columns());
  plan.signals = plan_names(model.signal_columns(), previous.model.signal_columns());
  plan.axes = plan_names(entry_names(config.axes), entry_names(previous.config.axes));
  plan.terms = prediction.plan_terms(previous.prediction);
  plan.same_domain = prediction.same_domain(previous.prediction);
}

void Stages::adopt(const Stages& previous) noexcept {
  signals.adopt(previous.signals, plan.signals);
  sensing.adopt(previous.sensing);
  reference.adopt(previous.reference, plan.columns, plan.signals);
  learned.adopt(previous.learned, plan.axes);
  prediction.adopt(previous.prediction, plan.terms, plan.same_domain);
  mode.adopt(previous.mode);
  cycle_update.adopt(previous.cycle_update, plan.columns, plan.signals, plan.axes, plan.terms);
  axes.adopt(previous.axes, plan.axes);
  record = previous.record;
  // This model has not been evaluated yet.
  record.displacement_known = false;
  record.reasons = 0;
}

void Stages::visit_state(StateArchive& archive) {
  auto& [cycle, stepped, now, dt_s, displacement_known, reasons] = record;
  archive(sensing);
  prediction.visit_lags(archive);
  archive(axes);
  learned.visit_learned(archive);
  prediction.visit_domain(archive);
  archive(cycle, stepped, now, dt_s);
  signals.visit_last(archive);
  reference.visit_temperatures(archive);
  signals.visit_of_model(archive);
  reference.visit_signals(archive);
  archive(prediction);
  learned.visit_measured(archive);
  prediction.visit_certainty(archive);
  archive(cycle_update, displacement_known, mode, reasons);
  cycle_update.visit_cycles(archive);
  learned.visit_operators(archive);
}

}  // namespace thermocomp
