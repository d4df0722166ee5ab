#include "estimator/pipeline/estimator.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "estimator/axes/axis_bank.hpp"
#include "estimator/checks.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/learning/probings.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/name_index.hpp"
#include "estimator/pipeline/prediction.hpp"
#include "estimator/pipeline/targets.hpp"
#include "estimator/sensing/sensing.hpp"
#include "estimator/sensing/sensor.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// Stages in the order of a step; each uses only its arguments.
struct Stages {
  /// @throws InvalidValue when configuration and model do not fit each other
  Stages(const EstimatorConfig& estimator_config, const ThermalModel& thermal_model);

  void visit_state(StateArchive& archive);

  /// Times and results of the last step.
  struct Record {
    std::uint64_t cycle{0};
    bool stepped{false};
    nanoseconds now{};
    double dt_s{0.0};
    bool displacement_known{false};
    std::uint32_t reasons{0};
  };
  /// Index of each of our items in the previous one for a reload, or -1.
  struct AdoptionPlan {
    std::vector<int> columns;
    std::vector<int> signals;
    std::vector<int> axes;
    std::vector<int> terms;
    bool same_domain{false};
    bool same_model{false};
  };

  const EstimatorConfig config;
  const ThermalModel model;  ///< in axis units: a diameter is its axis' displacement
  const std::vector<std::size_t> axis_output;  ///< axis -> output of the model

  SignalIntake signals;
  Sensing sensing;
  Reference reference;
  Probings learned;
  Prediction prediction;
  ModeDecision mode;
  CycleUpdate cycle_update;
  TargetRule targets;
  AxisBank axes;
  Record record;
  AdoptionPlan plan;
};

namespace {

const EstimatorConfig& checked(const EstimatorConfig& config, const ThermalModel& model) {
  config.compensation.validate();
  check_reference(config, model);
  // Rejects an invalid model before a stage reads its rows.
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

}  // namespace

Stages::Stages(const EstimatorConfig& estimator_config, const ThermalModel& thermal_model)
    : config(checked(estimator_config, thermal_model)),
      model(in_axis_units(thermal_model)),
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

namespace {

class ReasonSet {
 public:
  void add(bool holds, Reason reason) noexcept {
    if (holds) bits_ |= static_cast<std::uint32_t>(reason);
  }
  [[nodiscard]] std::uint32_t bits() const noexcept { return bits_; }

 private:
  std::uint32_t bits_{0};
};

/// Set of Reason of a step, from the results of the stages.
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

/// Offset in effect at the tool, as a displacement; for a travel interpolated between its nodes.
double compensated_now_um(const Stages& stages, std::size_t axis) noexcept {
  const AxisSpan span = stages.axes.span(axis);
  if (span.count == 1) return stages.axes.compensated_um(axis);
  std::array<double, axes_max> nodes_um{};
  for (std::size_t i = 0; i < span.count; ++i)
    nodes_um[i] = stages.axes.compensated_um(span.first + i);
  const double position_mm = stages.signals.of_model()[stages.prediction.place(axis).signal];
  return value_on_travel(std::span(stages.config.axes).subspan(span.first, span.count), nodes_um,
                         position_mm);
}

PastMoment present(const Stages& stages, std::size_t axis) noexcept {
  return stages.learned.present(axis, compensated_now_um(stages, axis),
                                stages.prediction.output_um(stages.axis_output[axis]));
}

/// Keeps the present state of each axis for parts measured later.
void remember(Stages& stages) noexcept {
  if (!stages.record.displacement_known || !stages.learned.must_remember(stages.record.now)) return;
  for (std::size_t i = 0; i < stages.axes.size(); ++i) {
    PastMoment moment = present(stages, i);
    moment.at = stages.record.now;
    stages.learned.remember(i, moment);
  }
}

}  // namespace

Estimator::Estimator(const EstimatorConfig& config, const ThermalModel& model)
    : stages_(std::make_unique<Stages>(config, model)) {}
Estimator::~Estimator() = default;
Estimator::Estimator(Estimator&&) noexcept = default;
Estimator& Estimator::operator=(Estimator&&) noexcept = default;

void Estimator::step(nanoseconds now, std::span<const Reading> readings,
                     const ControllerState& controller, OffsetCommand& command) noexcept {
  Stages& stages = *stages_;
  Stages::Record& last = stages.record;
  THERMOCOMP_ENSURE(!last.stepped || now >= last.now);
  StepTime time{now, 0.0, !last.stepped};
  if (last.stepped) time.dt_s = to_seconds(now - last.now);

  const Signals signals = stages.signals.step(now, controller);
  Temperatures temps = stages.sensing.step(now, readings);
  const ReferenceState reference = stages.reference.step(now, temps, signals);
  // A suspicion alone never ends the compensation.
  if (temps.weighed_down &&
      !stages.prediction.is_accurate_enough(stages.sensing.lost(), reference, signals))
    temps = stages.sensing.use_all(now);
  const Displacement displacement =
      stages.prediction.step(now, temps, reference, signals, stages.sensing.lost(), stages.learned);
  const Mode mode =
      stages.mode.step({time, displacement.known, signals.online, stages.axes.synced(),
                        controller.written, signals.disable >= 0.5});
  const std::span<const double> compensated_um =
      stages.cycle_update.step(now, displacement, mode == Mode::compensating, temps, reference,
                               signals, stages.prediction.model(), stages.learned);
  const Targets targets =
      stages.targets.step(stages.mode.targeted(), compensated_um, displacement, signals);
  stages.axes.step(time, targets, signals.online, controller, command);

  last = {last.cycle + 1,
          true,
          now,
          time.dt_s,
          displacement.known,
          reasons_of(signals, controller.written, temps, reference, displacement,
                     stages.mode.state(), targets, stages.axes)};
  remember(stages);
}

namespace {

/// Takes the reference only if all inputs are good: values of two moments would be a state that the
/// machine never had.
void take_reference(Stages& stages) noexcept {
  if (!stages.sensing.all_good()) return;
  const std::span<const double> temps_degC = stages.sensing.blocks().temps_degC();
  stages.reference.take(temps_degC);
  stages.sensing.end_suspicions();
  stages.prediction.restart();
  stages.learned.restart();
  stages.cycle_update.restart(stages.record.now, temps_degC, stages.signals.of_model());
}

/// State at the time of a `measured` command; none if it was not kept.
std::optional<PastMoment> moment_of(const Stages& stages, const Command& command,
                                    std::size_t axis) noexcept {
  if (command.ago_s == 0) return present(stages, axis);
  const PastMoment* then =
      stages.learned.past(axis, stages.record.now - std::chrono::seconds(command.ago_s));
  return then != nullptr ? std::optional(*then) : std::nullopt;
}

/// A value measured at the slide's position corrects all nodes of the travel.
void take_measured(Stages& stages, const Command& command) noexcept {
  Probings& learned = stages.learned;
  const AxisSpan span = stages.axes.span(command.axis);
  for (std::size_t i = span.first; i < span.end(); ++i) learned.note(i, command.value_um);
  if (!stages.record.displacement_known) return;  // nothing to compare with
  const MeasuredValue value{command.value_um, 1e-3 * command.sd_nm, command.source};
  for (std::size_t i = span.first; i < span.end(); ++i) {
    if (const std::optional<PastMoment> then = moment_of(stages, command, i))
      learned.learn(i, value, *then);
    else
      learned.refuse(i);
  }
}

}  // namespace

void Estimator::apply(const Command& command) noexcept {
  Stages& stages = *stages_;
  const bool has_axis = command.axis < stages.axes.size();
  switch (command.kind) {
    case CommandKind::enable:
      return stages.mode.enable(true);
    case CommandKind::disable:
      stages.mode.enable(false);
      return stages.axes.end_proves();
    case CommandKind::stop:
      stages.mode.stop();
      return stages.axes.end_proves();
    case CommandKind::reference:
      return take_reference(stages);
    case CommandKind::cycle_end:
      return stages.cycle_update.command();
    case CommandKind::measured:
      if (has_axis) take_measured(stages, command);
      return;
    case CommandKind::prove:
      if (has_axis) stages.axes.prove(command.axis, command.value_um);
      return;
    case CommandKind::release:
      if (has_axis) stages.axes.release(command.axis);
      return;
    case CommandKind::saved:
      if (has_axis) stages.axes.saved(command.axis, command.value_um);
      return;
    case CommandKind::accept:
      if (command.axis < stages.config.sensors.size()) stages.sensing.accept(command.axis);
      return;
  }
}

Estimator::Probed Estimator::probed(const Command& measured) const noexcept {
  const Stages& stages = *stages_;
  if (measured.axis >= stages.axes.size() || !stages.record.displacement_known) return {};
  const std::optional<PastMoment> then = moment_of(stages, measured, measured.axis);
  if (!then) return {};
  return {stages.learned.without_offset_um(measured.value_um, *then), then->model_um};
}

namespace {

void report_axis(const Stages& stages, std::size_t axis, AxisReport& out) noexcept {
  const AxisChannel& channel = stages.axes[axis];
  out.displacement_um = stages.prediction.axis_um(axis, stages.learned);
  out.target_um = channel.target_um();
  out.offset_um = channel.offset_um();
  out.applied_um = channel.applied_um();
  out.measured_um = stages.learned.measured_um(axis);
  out.synced = channel.synced();
  out.driven = stages.axes.driven(axis);
  out.disagrees = channel.mismatch();
  out.start = channel.start();
  out.start_unknown = channel.start_unknown();
  out.waits_for_disk = channel.waits_for_disk();
  out.corridor_um = channel.corridor_um();
  out.latched = channel.latched();
  out.releasing = channel.releasing();
  out.latched_mismatch = channel.latched_mismatch();
  out.at_bound = channel.at_bound();
  out.proving = channel.proving();
  out.offset_sd_um = stages.prediction.offset_sd_um(axis);
  out.held_um = stages.cycle_update.held_um(axis);
  out.claimed_sd_um = stages.prediction.claimed_sd_um(axis);
  out.probed_rms_um = stages.learned.rms_um(axis);
  out.probings = stages.learned.count(axis);
  out.last_probing = stages.learned.last(axis);
  out.entered_um = stages.learned.operator_um(axis).entered_um;
  out.absorbed_um = stages.learned.operator_um(axis).learned_um;
  out.correction = stages.learned.report(axis);
}

DomainReport domain_of(const Prediction& prediction) noexcept {
  DomainReport report;
  report.outside_share_24h = prediction.outside_share_24h();
  if (!prediction.domain()) return report;
  report.known = true;
  report.outside = prediction.domain()->outside();
  report.distance = prediction.domain()->distance();
  return report;
}

}  // namespace

Report Estimator::make_report() const {
  const Stages& stages = *stages_;
  Report out;
  out.sensors.resize(stages.config.sensors.size());
  out.inputs.resize(stages.reference.temps_degC().size());
  out.signals.resize(stages.signals.of_model().size());
  out.displacement_um.resize(stages.model.outputs.size());
  out.axes.resize(stages.axes.size());
  report(out);
  return out;
}

void Estimator::report(Report& out) const noexcept {
  const Stages& stages = *stages_;
  const ModeDecision::State& mode = stages.mode.state();
  const CycleHold& held = stages.cycle_update.hold();
  out.cycle = stages.record.cycle;
  out.now = stages.record.now;
  out.mode = mode.mode;
  out.mode_since = mode.mode_since;
  out.reasons = stages.record.reasons;
  out.enabled = mode.enabled;
  out.cycle_ends = stages.cycle_update.cycle_ends();
  out.remembered_s = std::chrono::duration<double>(stages.learned.remembered()).count();
  stages.sensing.report(out.sensors);
  const LostBlocks& lost = stages.sensing.lost();
  for (std::size_t i = 0; i < out.inputs.size(); ++i)
    out.inputs[i] = {lost.temps_degC()[i],
                     stages.reference.temps_degC()[i],
                     stages.sensing.blocks().good(i),
                     lost.estimated(i),
                     lost.sd_K(i),
                     held.temps_degC()[i]};
  for (std::size_t i = 0; i < out.signals.size(); ++i)
    out.signals[i] = {stages.signals.of_model()[i], stages.reference.signals()[i], held.signal(i)};
  for (std::size_t i = 0; i < out.displacement_um.size(); ++i)
    out.displacement_um[i] = stages.prediction.output_um(i);
  for (std::size_t i = 0; i < out.axes.size(); ++i) report_axis(stages, i, out.axes[i]);
  out.domain = domain_of(stages.prediction);
}

std::size_t Estimator::state_size_bytes() const noexcept {
  StateArchive archive;
  stages_->visit_state(archive);
  return archive.position_bytes();
}

void Estimator::save_state(std::span<std::byte> out) const noexcept {
  StateArchive archive(out);
  stages_->visit_state(archive);
  THERMOCOMP_ENSURE(archive.position_bytes() == out.size());
}

void Estimator::load_state(std::span<const std::byte> in) {
  StateArchive archive(in);
  if (in.size() != state_size_bytes())
    throw std::runtime_error("the estimator's state has another size than this program's");
  stages_->visit_state(archive);
}

void Estimator::plan_adoption(const Estimator& previous) {
  Stages& ours = *stages_;
  const Stages& theirs = *previous.stages_;
  Stages::AdoptionPlan& plan = ours.plan;
  ours.sensing.plan_adoption(theirs.sensing);
  plan.columns = plan_names(ours.model.temperature_columns(), theirs.model.temperature_columns());
  plan.signals = plan_names(ours.model.signal_columns(), theirs.model.signal_columns());
  plan.axes = plan_names(entry_names(ours.config.axes), entry_names(theirs.config.axes));
  plan.terms = ours.prediction.plan_terms(theirs.prediction);
  plan.same_domain = ours.prediction.same_domain(theirs.prediction);
  plan.same_model = predict_the_same(ours.model, theirs.model);
}

void Estimator::adopt(const Estimator& previous) noexcept {
  Stages& ours = *stages_;
  const Stages& theirs = *previous.stages_;
  const Stages::AdoptionPlan& plan = ours.plan;
  ours.signals.adopt(theirs.signals, plan.signals);
  ours.sensing.adopt(theirs.sensing);
  ours.reference.adopt(theirs.reference, plan.columns, plan.signals);
  ours.learned.adopt(theirs.learned, plan.axes);
  if (plan.same_model) ours.learned.adopt_errors(theirs.learned, plan.axes);
  ours.prediction.adopt(theirs.prediction, plan.terms, plan.same_domain);
  if (plan.same_model) ours.prediction.adopt_outside_share(theirs.prediction);
  ours.mode.adopt(theirs.mode);
  ours.cycle_update.adopt(theirs.cycle_update, plan.columns, plan.signals, plan.axes, plan.terms);
  ours.axes.adopt(theirs.axes, plan.axes);
  ours.record = theirs.record;
  // This model has not been evaluated yet.
  ours.record.displacement_known = false;
  ours.record.reasons = 0;
}

void Estimator::adopt_model(const Estimator& beside) noexcept {
  stages_->reference.complete(beside.stages_->reference);
  stages_->prediction.adopt_model(beside.stages_->prediction);
}

namespace {

/// Restores the state held between two cycle ends, as far as its temperatures can be measured.
void restore_held(Stages& stages, const PersistentState& state) {
  const std::vector<std::string> columns = stages.model.temperature_columns();
  const std::vector<std::string> names = stages.model.signal_columns();
  std::vector<double> temps_degC(columns.size(), not_a_number);
  std::vector<double> signals(names.size(), not_a_number);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    take_if_finite(state.held_degC, columns[i], temps_degC[i]);
    if (!TemperatureRange(stages.config, columns[i]).holds(temps_degC[i]))
      temps_degC[i] = not_a_number;
  }
  for (std::size_t i = 0; i < names.size(); ++i)
    take_if_finite(state.held_signals, names[i], signals[i]);
  stages.cycle_update.restore(temps_degC, signals);
}

}  // namespace

PersistentState Estimator::persistent_state(const Report& report) const {
  return thermocomp::persistent_state(stages_->config, stages_->model, report);
}

std::vector<std::string> Estimator::restore(const PersistentState& state) {
  Stages& stages = *stages_;
  std::vector<std::string> refused = impossible_references(
      stages.config, stages.model.temperature_columns(), state.reference_degC);
  stages.mode.enable(state.enabled && refused.empty());
  if (refused.empty() && state.model_reference_degC == reference_numbers(stages.model))
    stages.reference.restore(state.reference_degC, state.reference_signals);
  stages.sensing.restore(state.temp_degC, state.jumped_from_degC);
  restore_held(stages, state);
  for (std::size_t i = 0; i < stages.axes.size(); ++i) {
    const std::string& name = stages.config.axes[i].name;
    SentBefore before;
    take_if_finite(state.offset_um, name, before.saved_um);
    take_if_finite(state.recorded_um, name, before.recorded_um);
    before.is_corridor = state.corridor_um.contains(name);
    stages.axes.restore(i, before);
  }
  stages.learned.restore(state.correction);
  return refused;
}

std::uint32_t Estimator::forgotten_axes() const noexcept {
  return stages_->axes.last_offset_unknown();
}

const EstimatorConfig& Estimator::config() const noexcept {
  return stages_->config;
}
const ThermalModel& Estimator::model() const noexcept {
  return stages_->model;
}

}  // namespace thermocomp
