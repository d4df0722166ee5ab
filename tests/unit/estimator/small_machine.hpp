/// A small estimator with an obedient controller, for tests of single steps.
#pragma once

#include <chrono>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

using namespace std::chrono_literals;

/// Two blocks, one axis z, spindle speed with growth; smoothing off for plain figures.
inline EstimatorConfig small_config() {
  EstimatorConfig config;
  for (const char* name : {"s1", "s2"}) {
    SensorConfig sensor;
    sensor.name = name;
    sensor.smoothing.form = SmoothingForm::off;
    // Tests step temperatures freely; screening has tests of its own.
    sensor.screening.settle_s = 0.0;
    sensor.screening.rate_allowance_K = 50.0;
    config.sensors.push_back(sensor);
  }
  config.blocks = {{"head", "t1_degC", {0}}, {"column", "t2_degC", {1}}};
  config.signals = {"spindle_rpm", "cutting_on", "compensation_off_on"};
  config.axes = {{"z", "z_um", 1.0, {50.0, 10.0}}};
  config.compensation.disable_signal = "compensation_off_on";
  config.compensation.enabled_at_first_start = true;
  return config;
}

inline ThermalModel small_model() {
  ThermalModel model;
  model.inputs = {"t1_degC", "t2_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{5.0, 1.0}};
  return model;
}

inline ThermalModel model_with_growth() {
  ThermalModel model = small_model();
  model.terms = {{"speed_growth", "spindle_rpm", {}, {{"gain_um_per_unit2", {{"z_um", 1e-7}}}}}};
  return model;
}

/// An estimator with a controller that applies at once; one step is 1 s.
struct Machine {
  explicit Machine(const EstimatorConfig& config = small_config(),
                   const ThermalModel& model = small_model())
      : estimator(config, model), readings(config.sensors.size()) {
    controller.link_epoch = 1;
    controller.online = true;
    controller.written = controller.online;
    controller.applied_um[0] = 0.0;
    controller.signals[0] = 0.0;
    controller.signals[1] = 0.0;
    controller.signals[2] = 0.0;
  }
  void step(const std::vector<double>& temps_degC) {
    now += 1s;
    for (std::size_t i = 0; i < temps_degC.size(); ++i)
      readings[i] = {temps_degC[i], now,
                     std::isnan(temps_degC[i]) ? Fault::open_circuit : Fault::none};
    controller.taken_at = now;
    estimator.step(now, readings, controller, command);
    if (controller.online && command.valid[0]) controller.applied_um[0] = command.offset_um[0];
  }
  void steps(int count, const std::vector<double>& temps_degC) {
    for (int i = 0; i < count; ++i) step(temps_degC);
  }
  [[nodiscard]] Report report() const { return estimator.make_report(); }
  [[nodiscard]] bool reports(Reason reason) const { return has_reason(report().reasons, reason); }
  [[nodiscard]] double offset_um() const { return command.offset_um[0]; }

  Estimator estimator;
  std::vector<Reading> readings;
  ControllerState controller;
  OffsetCommand command;
  nanoseconds now{};
};

inline void reload(Machine& machine, const EstimatorConfig& config, const ThermalModel& model) {
  Estimator next(config, model);
  next.plan_adoption(machine.estimator);
  next.adopt(machine.estimator);
  machine.estimator = std::move(next);
}

inline constexpr double lost = not_a_number;

}  // namespace thermocomp
