#include "estimator/estimator.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "estimator/axis_channel.hpp"
#include "estimator/block_bank.hpp"
#include "estimator/checks.hpp"
#include "estimator/cycle_hold.hpp"
#include "estimator/displacement_model.hpp"
#include "estimator/lost_blocks.hpp"
#include "estimator/model_domain.hpp"
#include "estimator/name_index.hpp"
#include "estimator/outside_share.hpp"
#include "estimator/probed_error.hpp"
#include "estimator/temperature_range.hpp"

namespace thermocomp {
namespace {

constexpr int no_signal = -1;

/// No operating signal is larger; a value beyond is a garbled register, and its square would stay
/// in the lags for ever.
constexpr double signal_magnitude_max = 1e9;

/// An estimate that became too uncertain serves again below this share of the limit: at the limit
/// itself a moving slide would switch it on and off.
constexpr double certain_again = 0.9;

/// The model as LostBlocks is to see it.
ThermalModel estimating_model(const ThermalModel& model, const EstimatorConfig& config) {
  ThermalModel seen = model;
  if (!config.compensation.estimate_lost_blocks) seen.covariance_K2.clear();
  return seen;
}

/// What stands under the name, where it is a number.
void take(const std::map<std::string, double>& from, const std::string& name, double& to) {
  const auto found = from.find(name);
  if (found != from.end() && std::isfinite(found->second)) to = found->second;
}

/// The longest that a working sensor may take until its first reading.
nanoseconds settling_time(const EstimatorConfig& config) {
  double longest_s = 0.0;
  for (const SensorConfig& sensor : config.sensors)
    longest_s = std::max(longest_s, sensor.screening.stale_after_s);
  return std::chrono::duration_cast<nanoseconds>(seconds_d(longest_s));
}

}  // namespace

/// Everything that a step touches; sizes are fixed by the constructor.
struct Estimator::Parts {
  Parts(const EstimatorConfig& estimator_config, const ThermalModel& thermal_model);

  void take_signals(nanoseconds now, const ControllerState& controller) noexcept;
  [[nodiscard]] bool estimate_lost(nanoseconds now) noexcept;
  [[nodiscard]] bool certain() noexcept;
  void take_references() noexcept;
  [[nodiscard]] bool has_targets() const noexcept;
  void predict(nanoseconds now) noexcept;
  void decide_mode(nanoseconds now, bool data_good) noexcept;
  void step_axes(nanoseconds now, const ControllerState& controller) noexcept;
  [[nodiscard]] double target_um(std::size_t axis) const noexcept;
  void hold_cycle(nanoseconds now) noexcept;
  void take_cycle_end(nanoseconds now) noexcept;
  void note_measured(std::size_t axis, double value_um) noexcept;
  void correct(nanoseconds now) noexcept;
  [[nodiscard]] double model_change_um(std::size_t axis) const noexcept {
    return model_um[axis_output[axis]] - zero_um[axis_output[axis]];
  }
  [[nodiscard]] double predicted_um(std::size_t axis) const noexcept {
    return believed_share() * model_change_um(axis) + corrections[axis].correction_um();
  }
  [[nodiscard]] bool outside() const noexcept { return domain && domain->outside(); }
  /// What was learned by probing stays believed; the model is what left its domain.
  [[nodiscard]] double believed_share() const noexcept {
    const bool shrinks = config.compensation.outside_domain == OutsidePolicy::shrink;
    return shrinks && domain ? domain->believed_share() : 1.0;
  }
  [[nodiscard]] bool held_outside() const noexcept {
    return config.compensation.outside_domain == OutsidePolicy::hold && outside();
  }
  [[nodiscard]] double signal(int index) const noexcept {
    return index == no_signal ? not_a_number : all_signals[static_cast<std::size_t>(index)];
  }
  void add(Reason reason) noexcept { reasons |= static_cast<std::uint32_t>(reason); }
  void take_new_reference() noexcept;
  void restore_cycle_hold(const PersistentState& state);
  void visit_state(StateArchive& archive);

  EstimatorConfig config;
  ThermalModel thermal_model;
  std::vector<std::string> columns;
  BlockBank blocks;
  LostBlocks lost;
  DisplacementModel displacement;
  DisplacementModel at_reference;     ///< the same model, only ever asked for the zero
  std::optional<ModelDomain> domain;  ///< of a model that says what it was made from
  OutsideShare outside_share;
  std::vector<ProbedError> probed;  ///< one an axis
  std::vector<AxisChannel> axes;
  std::vector<RunningCorrection> corrections;  ///< one an axis
  CycleHold cycle_hold;
  CycleEnds cycle_ends;
  std::vector<std::size_t> axis_output;    ///< axis -> output
  std::vector<std::size_t> model_signals;  ///< model's signal -> configured signal
  int cutting_signal{no_signal};
  int disable_signal{no_signal};
  int cycle_end_signal{no_signal};
  nanoseconds controller_stale_after;
  nanoseconds hold;

  // state
  std::uint64_t cycle{0};
  bool stepped{false};
  nanoseconds now{};
  double dt_s{0.0};
  std::array<double, signals_max> all_signals{};
  bool controller_online{false};
  std::vector<double> reference_degC;
  std::vector<double> signal_values;      ///< of the model
  std::vector<double> model_um;           ///< of the outputs, as the model says
  std::vector<double> held_model_um;      ///< the same at the state that the cycle hold holds
  double held_share{not_a_number};        ///< of the model that was believed when the cycle ended
  std::vector<double> held_um;            ///< one an axis: what is compensated until the cycle ends
  std::vector<double> reference_signals;  ///< of the model, when the reference was taken
  bool zero_known{false};
  std::vector<double> zero_um;  ///< of the outputs: the model at the reference state
  std::vector<double> measured_um;
  std::vector<double> offset_sd_um;  ///< one an axis
  bool uncertain{false};             ///< the estimate does not serve
  bool predicted{false};             ///< model_um is from this step
  bool ever_good{false};
  nanoseconds lost_since{};
  bool enabled;
  bool stopping{false};  ///< the daemon is about to end: nowhere but to zero
  Mode mode{Mode::starting};
  nanoseconds mode_since{};
  std::uint32_t reasons{0};

  std::vector<double> rise_K;         ///< scratch, one a column
  std::vector<double> gain_um_per_K;  ///< scratch, one a column

  // how a reload takes over
  std::vector<int> column_plan;
  std::vector<int> signal_plan;
  std::vector<int> axis_plan;
  std::vector<int> term_plan;
  bool keep_reference{false};
  bool keep_domain{false};
};

Estimator::Parts::Parts(const EstimatorConfig& estimator_config, const ThermalModel& model)
    : config(estimator_config),
      thermal_model(model),
      columns(model.temperature_columns()),
      blocks(config, columns),
      lost(estimating_model(model, config), settling_time(config)),
      displacement(model),
      at_reference(model),
      cycle_hold(model, config.compensation.cycle_ahead),
      cycle_ends(config.compensation.cycles_per_update,
                 config.compensation.cycle_end_signal.ends_with("_on")),
      controller_stale_after(std::chrono::duration_cast<nanoseconds>(
          seconds_d(config.compensation.controller_stale_after_s))),
      hold(std::chrono::duration_cast<nanoseconds>(seconds_d(config.compensation.hold_s))),
      enabled(config.compensation.enabled_at_first_start) {
  config.compensation.validate();
  check_reference(config, model);
  if (model.made_from) domain.emplace(model);
  require(config.axes.size() <= axes_max, "axis", static_cast<double>(config.axes.size()),
          "are too many axes");
  require(config.signals.size() <= signals_max, "controller.signal",
          static_cast<double>(config.signals.size()), "are too many signals");
  all_signals.fill(not_a_number);
  for (const AxisConfig& axis : config.axes) {
    axes.emplace_back(axis, config.compensation, config.controller_reads_back);
    axis_output.push_back(
        index_of(model.outputs, axis.output, "axis.output", "is not an output of the model"));
    corrections.emplace_back(config.correction, model, axis_output.back());
    probed.emplace_back();
  }
  for (const std::string& name : model.signal_columns())
    model_signals.push_back(
        index_of(config.signals, name, "controller.signal", "the model needs this signal"));
  const auto optional_signal = [&](const std::string& name, const char* key) {
    return name.empty() ? no_signal
                        : static_cast<int>(index_of(config.signals, name, key,
                                                    "is not a signal of the controller"));
  };
  cutting_signal = optional_signal(config.compensation.cutting_signal, "cutting_signal");
  disable_signal = optional_signal(config.compensation.disable_signal, "disable_signal");
  cycle_end_signal = optional_signal(config.compensation.cycle_end_signal, "cycle_end_signal");
  reference_degC.assign(columns.size(), not_a_number);
  std::copy(model.reference_degC.begin(), model.reference_degC.end(), reference_degC.begin());
  signal_values.assign(model_signals.size(), not_a_number);
  model_um.assign(model.outputs.size(), not_a_number);
  held_model_um.assign(model.outputs.size(), not_a_number);
  held_um.assign(config.axes.size(), not_a_number);
  // A reference given as numbers means a machine at rest; a sampled one says that the machine is
  // straight now, whatever it is doing.
  reference_signals.assign(model_signals.size(), model.reference_degC.empty() ? not_a_number : 0.0);
  zero_um.assign(model.outputs.size(), not_a_number);
  measured_um.assign(config.axes.size(), not_a_number);
  offset_sd_um.assign(config.axes.size(), 0.0);
  rise_K.assign(columns.size(), 0.0);
  gain_um_per_K.assign(columns.size(), 0.0);
}

Estimator::Estimator(const EstimatorConfig& config, const ThermalModel& model)
    : parts_(std::make_unique<Parts>(config, model)) {}
Estimator::~Estimator() = default;
Estimator::Estimator(Estimator&&) noexcept = default;
Estimator& Estimator::operator=(Estimator&&) noexcept = default;

void Estimator::step(nanoseconds now, std::span<const Reading> readings,
                     const ControllerState& controller, OffsetCommand& command) noexcept {
  Parts& parts = *parts_;
  THERMOCOMP_ENSURE(!parts.stepped || now >= parts.now);
  parts.dt_s = parts.stepped ? 1e-9 * static_cast<double>((now - parts.now).count()) : 0.0;
  if (!parts.stepped) parts.lost_since = now;
  parts.now = now;
  parts.stepped = true;
  ++parts.cycle;
  parts.reasons = 0;

  bool blocks_good = parts.blocks.step(now, readings);
  parts.take_signals(now, controller);
  const bool signals_good = !has_reason(parts.reasons, Reason::signal_lost);
  parts.take_references();
  const bool referenced = !has_reason(parts.reasons, Reason::no_reference);
  const bool estimated = parts.estimate_lost(now) && !blocks_good;
  if (!blocks_good) parts.add(estimated ? Reason::block_estimated : Reason::block_lost);
  blocks_good = blocks_good || estimated;
  parts.predicted = blocks_good && signals_good && referenced;
  if (parts.predicted) parts.predict(now);
  if (parts.predicted && !parts.has_targets()) {
    parts.add(Reason::no_target);
    parts.predicted = false;
  }
  if (parts.outside()) parts.add(Reason::outside_domain);
  if (parts.domain && parts.predicted) parts.outside_share.step(now, parts.outside());
  parts.decide_mode(now, parts.predicted);
  parts.step_axes(now, controller);

  command.link_epoch = controller.link_epoch;
  command.look = controller.look;
  for (std::size_t i = 0; i < parts.axes.size(); ++i) {
    command.offset_um[i] = parts.axes[i].offset_um();
    command.valid[i] = parts.axes[i].driven();
  }
}

void Estimator::Parts::take_signals(nanoseconds at, const ControllerState& controller) noexcept {
  controller_online = controller.online && at - controller.taken_at <= controller_stale_after;
  if (!controller_online) {
    add(Reason::controller_offline);
    // Positions and switches of a silent controller are not to be acted on; the lost ones hold.
    if (!model_signals.empty()) add(Reason::signal_lost);
    return;
  }
  for (std::size_t i = 0; i < config.signals.size(); ++i)
    all_signals[i] = std::abs(controller.signals[i]) <= signal_magnitude_max ? controller.signals[i]
                                                                             : not_a_number;
  for (std::size_t i = 0; i < model_signals.size(); ++i) {
    signal_values[i] = all_signals[model_signals[i]];
    if (!std::isfinite(signal_values[i])) add(Reason::signal_lost);
  }
  // A switch whose position is unknown is neither on nor off: hold.
  if (disable_signal != no_signal && !std::isfinite(signal(disable_signal)))
    add(Reason::signal_lost);
}

/// @return whether every column is measured, or estimated well enough
bool Estimator::Parts::estimate_lost(nanoseconds at) noexcept {
  lost.step(at, blocks.temps_degC(), blocks.good());
  return certain() && lost.complete();
}

bool Estimator::Parts::certain() noexcept {
  std::fill(offset_sd_um.begin(), offset_sd_um.end(), 0.0);
  if (!lost.complete()) return false;
  if (lost.lost_count() == 0) {
    uncertain = false;
    return true;
  }
  // Without positions or a reference nothing is compensated, and nothing can be said.
  if (has_reason(reasons, Reason::signal_lost) || has_reason(reasons, Reason::no_reference))
    return !uncertain;
  for (std::size_t i = 0; i < columns.size(); ++i)
    rise_K[i] = lost.temps_degC()[i] - reference_degC[i];
  const double limit_um = config.compensation.offset_sd_um_max * (uncertain ? certain_again : 1.0);
  uncertain = false;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    displacement.slope(axis_output[i], rise_K, signal_values, gain_um_per_K);
    offset_sd_um[i] = lost.sd_of(gain_um_per_K);
    // Negated so that NaN is uncertain.
    if (!(offset_sd_um[i] <= limit_um)) uncertain = true;
  }
  return !uncertain;
}

void Estimator::Parts::take_references() noexcept {
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (!std::isfinite(reference_degC[i]) && blocks.good(i)) {
      reference_degC[i] = blocks.temps_degC()[i];
      zero_known = false;
    }
    if (!std::isfinite(reference_degC[i])) add(Reason::no_reference);
  }
  // Of a silent controller only the last signals are known; they are not those of this moment.
  for (std::size_t i = 0; controller_online && i < reference_signals.size(); ++i)
    if (!std::isfinite(reference_signals[i])) {
      reference_signals[i] = signal_values[i];
      zero_known = false;
    }
}

void Estimator::Parts::predict(nanoseconds at) noexcept {
  if (!zero_known) {
    at_reference.restart();
    at_reference.step(at, reference_degC, reference_degC, reference_signals, zero_um);
    zero_known = true;
  }
  displacement.step(at, lost.temps_degC(), reference_degC, signal_values, model_um);
  if (domain) domain->step(at, lost.temps_degC(), reference_degC, signal_values);
  correct(at);
}

/// Inputs that are good and a model that is may still give no number together.
bool Estimator::Parts::has_targets() const noexcept {
  for (std::size_t i = 0; i < axes.size(); ++i)
    if (!std::isfinite(predicted_um(i))) return false;
  return true;
}

void Estimator::Parts::correct(nanoseconds at) noexcept {
  for (std::size_t i = 0; i < columns.size(); ++i)
    rise_K[i] = lost.temps_degC()[i] - reference_degC[i];
  // What a probing taught waits for the end of the cut; unknown is taken for cutting.
  const bool may_change =
      cutting_signal == no_signal || (controller_online && signal(cutting_signal) < 0.5);
  for (RunningCorrection& correction : corrections) correction.step(at, rise_K, may_change);
}

void Estimator::Parts::decide_mode(nanoseconds at, bool data_good) noexcept {
  if (!enabled) add(Reason::operator_disabled);
  if (signal(disable_signal) >= 0.5) add(Reason::controller_disabled);
  const bool disabled = has_reason(reasons, Reason::operator_disabled) ||
                        has_reason(reasons, Reason::controller_disabled);
  const bool synced =
      std::all_of(axes.begin(), axes.end(), [](const AxisChannel& axis) { return axis.synced(); });
  const bool working =
      data_good && controller_online && synced && !has_reason(reasons, Reason::signal_lost);
  if (working) {
    ever_good = true;
    lost_since = at;
  }
  const bool given_up =
      !working && config.compensation.on_loss == LossPolicy::ramp_to_zero && at - lost_since > hold;
  Mode next = Mode::compensating;
  if (disabled)
    next = Mode::disabled;
  else if (stopping || given_up)
    next = Mode::ramping_to_zero;
  else if (!working)
    next = ever_good ? Mode::holding : Mode::starting;
  if (next != mode) {
    mode = next;
    mode_since = at;
  }
}

double Estimator::Parts::target_um(std::size_t axis) const noexcept {
  if (mode == Mode::disabled || mode == Mode::ramping_to_zero) return 0.0;
  if (mode != Mode::compensating || held_outside()) return not_a_number;
  const bool by_cycles = config.compensation.update == UpdateRule::each_cycle;
  return -config.axes[axis].sign * (by_cycles ? held_um[axis] : predicted_um(axis));
}

/// What the compensation goes by until the next cycle end, as of this step.
void Estimator::Parts::hold_cycle(nanoseconds at) noexcept {
  if (config.compensation.update != UpdateRule::each_cycle) return;
  if (cycle_ends.take(predicted && mode == Mode::compensating && !held_outside()))
    take_cycle_end(at);
  if (!predicted || !cycle_hold.holds()) return;
  cycle_hold.displacement(reference_degC, signal_values, held_model_um);
  for (std::size_t i = 0; i < columns.size(); ++i)
    rise_K[i] = cycle_hold.temps_degC()[i] - reference_degC[i];
  // Held like the temperatures; after a restart it is not known any more.
  const double share = std::isfinite(held_share) ? held_share : believed_share();
  for (std::size_t i = 0; i < axes.size(); ++i)
    held_um[i] = share * (held_model_um[axis_output[i]] - zero_um[axis_output[i]]) +
                 corrections[i].correction_um(rise_K);
}

void Estimator::Parts::take_cycle_end(nanoseconds at) noexcept {
  cycle_hold.cycle_end(at, lost.temps_degC(), signal_values, displacement);
  held_share = believed_share();
}

void Estimator::Parts::step_axes(nanoseconds at, const ControllerState& controller) noexcept {
  if (controller_online) cycle_ends.signal(signal(cycle_end_signal));
  hold_cycle(at);
  AxisInput input;
  input.now = at;
  input.dt_s = dt_s;
  input.link_epoch = controller.link_epoch;
  input.online = controller_online;
  if (config.compensation.hold_while_cutting) {
    // Only a clear "not cutting" lets the offset change.
    input.may_change = controller_online && signal(cutting_signal) < 0.5;
    if (!input.may_change) add(Reason::cutting);
  }
  // Lost data never clears an offset mid-cut, nor where it cannot be told whether it is one: it is
  // held as in Mode::holding, so that one outside a smaller bound still comes in.
  bool clearing_waits = false;
  if (mode == Mode::ramping_to_zero && cutting_signal != no_signal &&
      !(controller_online && signal(cutting_signal) < 0.5)) {
    clearing_waits = true;
    add(Reason::cutting);
  }
  for (std::size_t i = 0; i < axes.size(); ++i) {
    input.applied_um = controller.applied_um[i];
    input.taken_at = controller.taken_at;
    input.target_um = clearing_waits ? not_a_number : target_um(i);
    // Before the first cycle end there is nothing to go to: where it stands is the target.
    if (mode == Mode::compensating && !std::isfinite(input.target_um))
      input.target_um = axes[i].offset_um();
    axes[i].step(input);
    if (!axes[i].synced()) add(Reason::not_synced);
    if (axes[i].mismatch()) add(Reason::mismatch);
    if (axes[i].latched()) add(Reason::mismatch_latched);
    if (axes[i].at_bound()) add(Reason::at_bound);
    if (axes[i].out_of_bound()) add(Reason::applied_out_of_bound);
  }
}

void Estimator::apply(const Command& command) noexcept {
  Parts& parts = *parts_;
  switch (command.kind) {
    case CommandKind::enable:
      parts.enabled = true;
      break;
    case CommandKind::disable:
      parts.enabled = false;
      for (AxisChannel& axis : parts.axes) axis.end_prove();
      break;
    case CommandKind::release:
      if (command.axis < parts.axes.size()) parts.axes[command.axis].release();
      break;
    case CommandKind::reference:
      parts.take_new_reference();
      break;
    case CommandKind::measured:
      if (command.axis < parts.axes.size()) parts.note_measured(command.axis, command.value_um);
      break;
    case CommandKind::cycle_end:
      parts.cycle_ends.command();
      break;
    case CommandKind::prove:
      if (command.axis < parts.axes.size()) parts.axes[command.axis].prove(command.value_um);
      break;
    case CommandKind::stop:
      parts.stopping = true;
      for (AxisChannel& axis : parts.axes) axis.end_prove();
      break;
  }
}

void Estimator::Parts::note_measured(std::size_t axis, double value_um) noexcept {
  measured_um[axis] = value_um;
  if (!predicted) return;  // nothing to compare it with
  double total_um = value_um;
  if (config.correction.measured == MeasuredMeaning::remaining) {
    const double applied_um = axes[axis].applied_um();
    total_um -=
        config.axes[axis].sign * (std::isfinite(applied_um) ? applied_um : axes[axis].offset_um());
  }
  probed[axis].take(total_um - model_change_um(axis));
  corrections[axis].measured(total_um, model_change_um(axis));
}

void Estimator::Parts::take_new_reference() noexcept {
  // All or nothing: a reference of two moments would be no state the machine was ever in.
  for (std::size_t i = 0; i < columns.size(); ++i)
    if (!blocks.good(i)) return;
  for (std::size_t i = 0; i < columns.size(); ++i) reference_degC[i] = blocks.temps_degC()[i];
  std::fill(reference_signals.begin(), reference_signals.end(), not_a_number);
  displacement.restart();
  if (domain) domain->restart();
  for (RunningCorrection& correction : corrections) correction.restart();
  if (cycle_hold.holds()) cycle_hold.restart(now, blocks.temps_degC(), signal_values);
}

Report Estimator::make_report() const {
  Report out;
  out.sensors.resize(parts_->config.sensors.size());
  out.inputs.resize(parts_->columns.size());
  out.signals.resize(parts_->signal_values.size());
  out.displacement_um.resize(parts_->thermal_model.outputs.size());
  out.axes.resize(parts_->axes.size());
  report(out);
  return out;
}

void Estimator::report(Report& out) const noexcept {
  const Parts& parts = *parts_;
  out.cycle = parts.cycle;
  out.now = parts.now;
  out.mode = parts.mode;
  out.mode_since = parts.mode_since;
  out.reasons = parts.reasons;
  out.enabled = parts.enabled;
  out.cycle_ends = parts.cycle_ends.count();
  parts.blocks.report(out.sensors);
  for (std::size_t i = 0; i < parts.columns.size(); ++i)
    out.inputs[i] = {parts.lost.temps_degC()[i], parts.reference_degC[i],
                     parts.blocks.good(i),       parts.lost.estimated(i),
                     parts.lost.sd_K(i),         parts.cycle_hold.temps_degC()[i]};
  for (std::size_t i = 0; i < parts.model_um.size(); ++i)
    out.displacement_um[i] = parts.model_um[i] - parts.zero_um[i];
  for (std::size_t i = 0; i < parts.signal_values.size(); ++i)
    out.signals[i] = {parts.signal_values[i], parts.reference_signals[i],
                      parts.cycle_hold.signal(i)};
  for (std::size_t i = 0; i < parts.axes.size(); ++i) {
    const AxisChannel& axis = parts.axes[i];
    AxisReport& line = out.axes[i];
    line.displacement_um = parts.predicted_um(i);
    line.held_um = parts.held_um[i];
    line.correction = parts.corrections[i].report();
    line.target_um = axis.target_um();
    line.offset_um = axis.offset_um();
    line.applied_um = axis.applied_um();
    line.measured_um = parts.measured_um[i];
    line.synced = axis.synced();
    line.driven = axis.driven();
    line.mismatch = axis.mismatch();
    line.latched = axis.latched();
    line.releasing = axis.releasing();
    line.latched_mismatch = axis.latched_mismatch();
    line.at_bound = axis.at_bound();
    line.proving = axis.proving();
    line.offset_sd_um = parts.offset_sd_um[i];
    line.claimed_sd_um = parts.domain ? parts.domain->sd_um(parts.axis_output[i]) : not_a_number;
    line.probed_rms_um = parts.probed[i].rms_um();
  }
  out.domain.known = parts.domain.has_value();
  out.domain.outside = parts.outside();
  out.domain.distance = parts.domain ? parts.domain->distance() : not_a_number;
  out.domain.outside_share_24h = parts.outside_share.share();
}

void Estimator::Parts::visit_state(StateArchive& archive) {
  archive(blocks, lost, displacement);
  for (AxisChannel& axis : axes) archive(axis);
  for (RunningCorrection& correction : corrections) archive(correction);
  for (ProbedError& error : probed) archive(error);
  if (domain) archive(*domain);
  archive(outside_share);
  archive(cycle, stepped, now, dt_s, all_signals, controller_online, reference_degC, signal_values,
          reference_signals, zero_known, model_um, zero_um, measured_um, offset_sd_um, uncertain,
          held_share, held_um, predicted, ever_good, lost_since, enabled, stopping, mode,
          mode_since, reasons, cycle_hold, cycle_ends);
}

std::size_t Estimator::state_size_bytes() const noexcept {
  StateArchive archive;
  parts_->visit_state(archive);
  return archive.position_bytes();
}

void Estimator::save_state(std::span<std::byte> out) const noexcept {
  StateArchive archive(out);
  parts_->visit_state(archive);
  THERMOCOMP_ENSURE(archive.position_bytes() == out.size());
}

void Estimator::load_state(std::span<const std::byte> in) {
  if (in.size() != state_size_bytes())
    throw std::runtime_error("the estimator's state has another size than this program's");
  StateArchive archive(in);
  parts_->visit_state(archive);
}

std::map<std::string, double> Estimator::model_reference_degC() const {
  std::map<std::string, double> numbers;
  const ThermalModel& model = parts_->thermal_model;
  for (std::size_t i = 0; i < model.reference_degC.size(); ++i)
    numbers[model.inputs[i]] = model.reference_degC[i];
  return numbers;
}

std::vector<std::string> Estimator::restore(const PersistentState& state) {
  Parts& parts = *parts_;
  std::vector<std::string> refused =
      impossible_references(parts.config, parts.columns, state.reference_degC);
  parts.enabled = state.enabled && refused.empty();
  if (refused.empty() && state.model_reference_degC == model_reference_degC()) {
    for (std::size_t i = 0; i < parts.columns.size(); ++i)
      take(state.reference_degC, parts.columns[i], parts.reference_degC[i]);
    const auto signal_columns = parts.thermal_model.signal_columns();
    for (std::size_t i = 0; i < signal_columns.size(); ++i)
      take(state.reference_signals, signal_columns[i], parts.reference_signals[i]);
  }
  for (std::size_t i = 0; i < parts.columns.size(); ++i) {
    double temp_degC = not_a_number;
    take(state.temp_degC, parts.columns[i], temp_degC);
    parts.lost.restore(i, temp_degC);
  }
  parts.restore_cycle_hold(state);
  for (std::size_t i = 0; i < parts.axes.size(); ++i) {
    double offset_um = 0.0;
    take(state.offset_um, parts.config.axes[i].name, offset_um);
    parts.axes[i].restore(offset_um);
    parts.corrections[i].restore(state.correction, parts.config.axes[i].name);
  }
  return refused;
}

void Estimator::Parts::restore_cycle_hold(const PersistentState& state) {
  std::vector<double> temps_degC(columns.size(), not_a_number);
  std::vector<double> signals(signal_values.size(), not_a_number);
  const auto signal_columns = thermal_model.signal_columns();
  for (std::size_t i = 0; i < temps_degC.size(); ++i) {
    take(state.held_degC, columns[i], temps_degC[i]);
    if (!TemperatureRange(config, columns[i]).holds(temps_degC[i])) temps_degC[i] = not_a_number;
  }
  for (std::size_t i = 0; i < signals.size(); ++i)
    take(state.held_signals, signal_columns[i], signals[i]);
  cycle_hold.restore(temps_degC, signals);
}

void Estimator::plan_adoption(const Estimator& previous) {
  Parts& parts = *parts_;
  const Parts& other = *previous.parts_;
  const auto axis_names = [](const EstimatorConfig& config) {
    std::vector<std::string> names;
    for (const AxisConfig& axis : config.axes) names.push_back(axis.name);
    return names;
  };
  parts.blocks.plan_adoption(other.blocks);
  parts.lost.plan_adoption(other.lost);
  parts.column_plan = plan_names(parts.columns, other.columns);
  parts.signal_plan =
      plan_names(parts.thermal_model.signal_columns(), other.thermal_model.signal_columns());
  parts.axis_plan = plan_names(axis_names(parts.config), axis_names(other.config));
  parts.term_plan = parts.displacement.plan_terms(other.displacement);
  parts.keep_domain = parts.domain && other.domain && parts.domain->alike(*other.domain);
  // Numbers newly written into the model file are meant; otherwise the machine's state stays.
  parts.keep_reference = parts.thermal_model.reference_degC == other.thermal_model.reference_degC;
}

void Estimator::adopt(const Estimator& previous) noexcept {
  Parts& parts = *parts_;
  const Parts& other = *previous.parts_;
  parts.blocks.adopt(other.blocks);
  parts.lost.adopt(other.lost);
  parts.displacement.adopt_terms(previous.parts_->displacement, parts.term_plan);
  if (parts.keep_domain) parts.domain->adopt(*other.domain);
  parts.outside_share = other.outside_share;
  if (parts.keep_reference) {
    take_by_plan(parts.column_plan, other.reference_degC, parts.reference_degC);
    take_by_plan(parts.signal_plan, other.reference_signals, parts.reference_signals);
  }
  take_by_plan(parts.signal_plan, other.signal_values, parts.signal_values);
  if (parts.config.signals == other.config.signals) parts.all_signals = other.all_signals;
  for (std::size_t i = 0; i < parts.axes.size(); ++i) {
    if (parts.axis_plan[i] < 0) continue;
    const auto from = static_cast<std::size_t>(parts.axis_plan[i]);
    parts.axes[i].adopt(other.axes[from]);
    parts.measured_um[i] = other.measured_um[from];
    parts.corrections[i].adopt(other.corrections[from]);
    parts.held_um[i] = other.held_um[from];
    parts.probed[i] = other.probed[from];
  }
  parts.cycle = other.cycle;
  parts.stepped = other.stepped;
  parts.now = other.now;
  parts.dt_s = other.dt_s;
  parts.ever_good = other.ever_good;
  parts.lost_since = other.lost_since;
  parts.enabled = other.enabled;
  parts.stopping = other.stopping;
  parts.mode = other.mode;
  parts.mode_since = other.mode_since;
  parts.uncertain = other.uncertain;
  parts.held_share = other.held_share;
  parts.cycle_hold.adopt(previous.parts_->cycle_hold, parts.column_plan, parts.signal_plan,
                         parts.term_plan);
  parts.cycle_ends.adopt(other.cycle_ends, parts.config.compensation.cycle_end_signal ==
                                               other.config.compensation.cycle_end_signal);
}

const EstimatorConfig& Estimator::config() const noexcept {
  return parts_->config;
}
const ThermalModel& Estimator::model() const noexcept {
  return parts_->thermal_model;
}

}  // namespace thermocomp
