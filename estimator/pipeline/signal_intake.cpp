#include "estimator/pipeline/signal_intake.hpp"

#include <cmath>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

/// Larger values are garbled registers, whose squares would stay in the lags for ever.
constexpr double signal_magnitude_max = 1e9;

std::vector<std::size_t> indices_of_model(const EstimatorConfig& config,
                                          const ThermalModel& model) {
  static_assert(signals_max == 48);
  require(config.signals.size() <= signals_max, "controller.signal",
          static_cast<double>(config.signals.size()), "must be at most 48");
  std::vector<std::size_t> indices;
  for (const std::string& name : model.signal_columns())
    indices.push_back(
        index_of(config.signals, name, "controller.signal", "the model needs this signal"));
  return indices;
}

std::optional<std::size_t> switch_index(const EstimatorConfig& config, const std::string& name,
                                        const char* key) {
  if (name.empty()) return std::nullopt;
  return index_of(config.signals, name, key, "is not a signal of the controller");
}

}  // namespace

SignalIntake::SignalIntake(const EstimatorConfig& config, const ThermalModel& model)
    : names_(config.signals),
      model_signals_(indices_of_model(config, model)),
      cutting_(switch_index(config, config.compensation.cutting_signal, "cutting_signal")),
      disable_(switch_index(config, config.compensation.disable_signal, "disable_signal")),
      cycle_end_(switch_index(config, config.compensation.cycle_end_signal, "cycle_end_signal")),
      stale_after_(to_nanoseconds(config.compensation.controller_stale_after_s)),
      of_model_(model_signals_.size(), not_a_number) {
  state_.last.fill(not_a_number);
}

Signals SignalIntake::step(nanoseconds now, const ControllerState& controller) noexcept {
  state_.online = controller.online && now - controller.taken_at <= stale_after_;
  Signals signals;
  signals.online = state_.online;
  signals.complete = state_.online ? take(controller) : model_signals_.empty();
  signals.of_model = of_model_;
  signals.watches_cutting = cutting_.has_value();
  signals.cutting = last_value(cutting_);
  signals.disable = last_value(disable_);
  signals.cycle_end = last_value(cycle_end_);
  return signals;
}

/// @return true if all needed signals are known
bool SignalIntake::take(const ControllerState& controller) noexcept {
  for (std::size_t i = 0; i < names_.size(); ++i)
    state_.last[i] = std::abs(controller.signals[i]) <= signal_magnitude_max ? controller.signals[i]
                                                                             : not_a_number;
  // A switch in an unknown position counts as missing: hold.
  bool complete = !disable_ || std::isfinite(last_value(disable_));
  for (std::size_t i = 0; i < model_signals_.size(); ++i) {
    of_model_[i] = state_.last[model_signals_[i]];
    complete = complete && std::isfinite(of_model_[i]);
  }
  return complete;
}

void SignalIntake::adopt(const SignalIntake& previous, const std::vector<int>& plan) noexcept {
  take_by_plan(plan, previous.of_model_, of_model_);
  // `online` is set by the next step.
  if (names_ == previous.names_) state_.last = previous.state_.last;
}

}  // namespace thermocomp
