#include "estimator/pipeline/report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "estimator/checks.hpp"
#include "estimator/learning/probings.hpp"

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
  add(state.correction, name + ".probed_um", axis.last_probing.without_offset_um);
  add(state.correction, name + ".probed_model_um", axis.last_probing.model_um);
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

PersistentState persistent_state(const EstimatorConfig& config, const ThermalModel& model,
                                 const Report& report) {
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

}  // namespace thermocomp
