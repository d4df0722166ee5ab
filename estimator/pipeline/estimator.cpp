#include "estimator/pipeline/estimator.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <optional>
#include <span>
#include <stdexcept>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"
#include "estimator/pipeline/stages.hpp"
#include "estimator/sensing/screening.hpp"

namespace thermocomp {
namespace {

void add(std::map<std::string, double>& values, const std::string& name, double value) {
  if (std::isfinite(value)) values[name] = value;
}

void add_inputs(const std::vector<std::string>& columns, const Report& report,
                PersistentState& state) {
  THERMOCOMP_ENSURE(columns.size() == report.inputs.size());
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const InputReport& input = report.inputs[i];
    add(state.reference_degC, columns[i], input.reference_degC);
    add(state.held_degC, columns[i], input.held_degC);
    if (input.good || input.estimated) add(state.temp_degC, columns[i], input.temp_degC);
  }
}

void add_axis(const std::string& name, const AxisReport& axis, PersistentState& state) {
  add(state.offset_um, name, axis.offset_um);
  add(state.corridor_um, name, axis.corridor_um);
  const auto add_learned = [&](const std::string& key, double value) {
    state.correction[std::string(name).append(".").append(key)] = value;
  };
  for (const auto& [key, value] : RunningCorrection::persistent(axis.correction))
    add_learned(key, value);
  if (axis.entered_um == 0.0 && axis.absorbed_um == 0.0) return;
  add_learned("entered_um", axis.entered_um);
  add_learned("absorbed_um", axis.absorbed_um);
}

bool nears_an_edge(const PersistentState& now, const PersistentState& saved) {
  return std::any_of(now.corridor_um.begin(), now.corridor_um.end(), [&](const auto& corridor) {
    const auto& [name, width_um] = corridor;
    const auto before = saved.offset_um.find(name);
    const auto offset = now.offset_um.find(name);
    return before == saved.offset_um.end() || offset == now.offset_um.end() ||
           std::abs(offset->second - before->second) >= 0.25 * width_um;
  });
}

}  // namespace

std::map<std::string, double> reference_numbers(const ThermalModel& model) {
  std::map<std::string, double> numbers;
  for (std::size_t i = 0; i < model.reference_degC.size(); ++i)
    numbers[model.inputs[i]] = model.reference_degC[i];
  return numbers;
}

bool must_be_saved(const PersistentState& now, const PersistentState& saved) {
  return now.enabled != saved.enabled || now.reference_degC != saved.reference_degC ||
         now.model_reference_degC != saved.model_reference_degC ||
         now.jumped_from_degC != saved.jumped_from_degC ||
         now.reference_signals != saved.reference_signals || now.held_degC != saved.held_degC ||
         now.held_signals != saved.held_signals || now.correction != saved.correction ||
         now.corridor_um != saved.corridor_um || nears_an_edge(now, saved);
}

std::vector<Command> saved_commands(const EstimatorConfig& config, const PersistentState& saved) {
  std::vector<Command> commands;
  for (std::size_t i = 0; i < config.axes.size(); ++i) {
    const std::string& name = config.axes[i].name;
    const auto offset = saved.offset_um.find(name);
    if (saved.corridor_um.contains(name) && offset != saved.offset_um.end())
      commands.push_back({CommandKind::saved, static_cast<std::uint32_t>(i), offset->second});
  }
  return commands;
}

namespace {

/// Takes the reference only if all inputs are good: values of two moments would be a state in which
/// the machine never was.
void take_reference(Stages& stages) noexcept {
  if (!stages.sensing.all_good()) return;
  const std::span<const double> temps_degC = stages.sensing.blocks().temps_degC();
  stages.reference.take(temps_degC);
  stages.sensing.end_suspicions();
  stages.prediction.restart();
  stages.learned.restart();
  stages.cycle_update.restart(stages.record.now, temps_degC, stages.signals.of_model());
}

/// Offset of the tool now, as a displacement; for a travel interpolated between its nodes.
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

/// State at the time of a `measured` command; none: not kept.
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

/// Keeps the present state of each axis for parts measured later.
void remember(Stages& stages) noexcept {
  if (!stages.record.displacement_known || !stages.learned.must_remember(stages.record.now)) return;
  for (std::size_t i = 0; i < stages.axes.size(); ++i) {
    PastMoment moment = present(stages, i);
    moment.at = stages.record.now;
    stages.learned.remember(i, moment);
  }
}

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

Estimator::Estimator(const EstimatorConfig& config, const ThermalModel& model)
    : stages_(std::make_unique<Stages>(config, model)) {}
Estimator::~Estimator() = default;
Estimator::Estimator(Estimator&&) noexcept = default;
Estimator& Estimator::operator=(Estimator&&) noexcept = default;

void Estimator::step(nanoseconds now, std::span<const Reading> readings,
                     const ControllerState& controller, OffsetCommand& command) noexcept {
  stages_->step(now, readings, controller, command);
  remember(*stages_);
}

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

Report Estimator::make_report() const {
  Report out = sized_report(*stages_);
  report(out);
  return out;
}

void Estimator::report(Report& out) const noexcept {
  fill_report(*stages_, out);
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

PersistentState Estimator::persistent_state(const Report& report) const {
  const EstimatorConfig& config = stages_->config;
  const ThermalModel& model = stages_->model;
  PersistentState state;
  state.enabled = report.enabled;
  state.model_reference_degC = reference_numbers(model);
  add_inputs(model.temperature_columns(), report, state);
  const std::vector<std::string> signals = model.signal_columns();
  THERMOCOMP_ENSURE(signals.size() == report.signals.size());
  for (std::size_t i = 0; i < signals.size(); ++i) {
    add(state.reference_signals, signals[i], report.signals[i].reference);
    add(state.held_signals, signals[i], report.signals[i].held);
  }
  THERMOCOMP_ENSURE(config.sensors.size() == report.sensors.size());
  for (std::size_t i = 0; i < report.sensors.size(); ++i)
    add(state.jumped_from_degC, config.sensors[i].name, report.sensors[i].jumped_from_degC);
  THERMOCOMP_ENSURE(config.axes.size() == report.axes.size());
  for (std::size_t i = 0; i < report.axes.size(); ++i) {
    state.sign[config.axes[i].name] = config.axes[i].sign;
    add_axis(config.axes[i].name, report.axes[i], state);
  }
  return state;
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

void Estimator::plan_adoption(const Estimator& previous) {
  stages_->plan_adoption(*previous.stages_);
}

void Estimator::adopt(const Estimator& previous) noexcept {
  stages_->adopt(*previous.stages_);
}

void Estimator::adopt_model(const Estimator& beside) noexcept {
  stages_->reference.complete(beside.stages_->reference);
  stages_->prediction.adopt_model(beside.stages_->prediction);
}

std::uint32_t Estimator::forgotten_axes() const noexcept {
  return stages_->axes.forgotten();
}

const EstimatorConfig& Estimator::config() const noexcept {
  return stages_->config;
}
const ThermalModel& Estimator::model() const noexcept {
  return stages_->model;
}

}  // namespace thermocomp
