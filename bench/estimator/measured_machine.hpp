/// The estimator with measured temperatures: one sensor and one block per model input, and a
/// controller that applies every offset.
#pragma once

#include <chrono>
#include <cmath>
#include <cstddef>
#include <vector>

#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

/// Enabled, with bounds and slew limits beyond all measured displacements.
inline EstimatorConfig measured_config(const ThermalModel& model, double stale_after_s) {
  EstimatorConfig config;
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    SensorConfig sensor;
    sensor.name = model.inputs[i];
    sensor.screening.stale_after_s = stale_after_s;
    sensor.screening.settle_s = 0.0;
    config.sensors.push_back(sensor);
    config.blocks.push_back({model.inputs[i], model.inputs[i], {i}});
  }
  for (const std::string& output : model.outputs)
    config.axes.push_back({output, output, 1.0, {500.0, 1000.0}});
  config.controller_reads_back = false;
  config.compensation.enabled_at_first_start = true;
  return config;
}

class MeasuredMachine {
 public:
  MeasuredMachine(const EstimatorConfig& config, const ThermalModel& model)
      : estimator_(config, model),
        report_(estimator_.make_report()),
        readings_(model.inputs.size()) {
    controller_.online = true;
    controller_.written = controller_.online;
    controller_.link_epoch = 1;
    controller_.applied_um.fill(0.0);
  }
  /// @param temps_degC  one per input; NaN: no answer  @param lost  inputs with an open circuit
  void step(double time_s, const std::vector<double>& temps_degC,
            const std::vector<std::size_t>& lost = {}) {
    const nanoseconds now =
        std::chrono::seconds(1) + std::chrono::duration_cast<nanoseconds>(seconds_d(time_s));
    for (std::size_t i = 0; i < readings_.size(); ++i)
      readings_[i] = {temps_degC[i], now,
                      std::isfinite(temps_degC[i]) ? Fault::none : Fault::no_answer};
    for (const std::size_t i : lost) readings_[i] = {not_a_number, now, Fault::open_circuit};
    controller_.taken_at = now;
    estimator_.step(now, readings_, controller_, command_);
  }
  [[nodiscard]] const OffsetCommand& offsets() const { return command_; }
  [[nodiscard]] const Report& report() {
    estimator_.report(report_);
    return report_;
  }
  [[nodiscard]] std::vector<std::byte> state() const {
    std::vector<std::byte> bytes(estimator_.state_size_bytes());
    estimator_.save_state(bytes);
    return bytes;
  }
  void load(const std::vector<std::byte>& state) { estimator_.load_state(state); }

 private:
  Estimator estimator_;
  Report report_;
  std::vector<Reading> readings_;
  ControllerState controller_;
  OffsetCommand command_;
};

}  // namespace thermocomp
