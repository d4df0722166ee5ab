#include "random_machine.hpp"

#include <array>
#include <string>
#include <vector>

namespace thermocomp::property {
namespace {

SmoothingConfig random_smoothing(Chance& chance) {
  SmoothingConfig smoothing;
  smoothing.form = static_cast<SmoothingForm>(chance.below(3));
  smoothing.history = static_cast<SmoothingHistory>(chance.below(2));
  smoothing.period_s = chance.one_in(2) ? 0.0 : chance.between(0.1, 5.0);
  smoothing.samples = 3 + chance.below(8);
  smoothing.half_width_K = chance.between(0.05, 1.0);
  smoothing.outage_s = chance.between(1.0, 30.0);
  return smoothing;
}

/// Three inputs that mostly change together, at times exactly.
void add_covariance(Chance& chance, ThermalModel& model) {
  const double own_K2 = chance.one_in(4) ? 0.0 : chance.between(0.0, 1.0);
  std::array<double, 3> together_K{};
  for (double& each : together_K) each = chance.between(-2.0, 2.0);
  for (std::size_t i = 0; i < together_K.size(); ++i) {
    auto& row = model.covariance_K2.emplace_back();
    for (std::size_t j = 0; j < together_K.size(); ++j)
      row.push_back(together_K[i] * together_K[j] + (i == j ? own_K2 : 0.0));
  }
  model.covariance_growth.drift_time_s = chance.one_in(3) ? 0.0 : chance.between(1.0, 1000.0);
  if (chance.one_in(2)) model.covariance_growth.scatter_factor = {0.5, 0.0, 2.0};
}

/// A domain that drifting readings leave and re-enter.
void add_domain(Chance& chance, ThermalModel& model) {
  MadeFrom& made_from = model.made_from.emplace();
  made_from.columns = model.inputs;
  made_from.low.assign(model.inputs.size(), 15.0);
  made_from.high.assign(model.inputs.size(), 30.0);
  made_from.taus_s = {0.0};
  if (chance.one_in(2)) made_from.taus_s.push_back(chance.between(1.0, 300.0));
  made_from.distance_max = chance.between(0.3, 2.0);
  const std::size_t levels = model.inputs.size();
  const std::size_t features = levels * (1 + made_from.taus_s.size());
  for (std::size_t i = 0; i < features; ++i) {
    made_from.mean.push_back(i < levels ? chance.between(20.0, 23.0) : chance.between(-0.5, 0.5));
    made_from.covariance.emplace_back(features, 0.0)[i] = chance.between(0.3, 3.0);
  }
  for (const std::string& output : model.outputs)
    made_from.outputs[output] = {1.0, 0.1, 600.0, chance.between(0.5, 3.0), 10.0, 8.0};
}

}  // namespace

EstimatorConfig random_config(Chance& chance) {
  EstimatorConfig config;
  const SmoothingConfig smoothing = random_smoothing(chance);
  for (std::size_t i = 0; i < sensors_count; ++i) {
    SensorConfig sensor;
    sensor.name = std::string("s").append(1, static_cast<char>('1' + i));
    sensor.smoothing = smoothing;
    sensor.screening.stale_after_s = chance.between(0.5, 5.0);
    sensor.screening.rate_K_per_s_max = chance.between(0.1, 5.0);
    sensor.screening.stuck_after_s = chance.one_in(3) ? chance.between(5.0, 50.0) : 0.0;
    // Half of the machines accept the first value at once.
    sensor.screening.settle_s = chance.one_in(2) ? 0.0 : chance.between(0.5, 5.0);
    sensor.module = std::string("m").append(1, static_cast<char>('1' + i / 2));
    config.sensors.push_back(sensor);
  }
  if (chance.one_in(3)) config.sensors[0].reference_sensor = 5;
  config.blocks = {{"b1", "t1_degC", {0, 1}}, {"b2", "t2_degC", {2, 3, 4}}, {"b3", "t3_degC", {5}}};
  config.signals = {"spindle_rpm", "y_mm", "cutting_on", "off_on"};
  const std::array<const char*, axes_count> names{"x", "y", "z"};
  const std::array<const char*, axes_count> outputs{"x_um", "y_um", "z_um"};
  for (std::size_t i = 0; i < axes_count; ++i)
    config.axes.push_back({names[i],
                           outputs[i],
                           chance.one_in(2) ? 1.0 : -1.0,
                           {chance.between(3.0, 100.0), chance.between(0.1, 20.0)}});
  config.compensation.on_loss = static_cast<LossPolicy>(chance.below(2));
  config.compensation.hold_s = chance.between(0.0, 20.0);
  config.compensation.hold_while_cutting = chance.one_in(4);
  config.compensation.cutting_signal = "cutting_on";
  config.compensation.disable_signal = "off_on";
  config.compensation.enabled_at_first_start = true;
  config.compensation.mismatch_um = chance.between(0.5, 3.0);
  config.compensation.mismatch_after_s = chance.between(0.5, 3.0);
  config.compensation.prove_hold_s = chance.between(0.0, 2.0);
  config.compensation.estimate_lost_blocks = !chance.one_in(5);
  config.compensation.offset_sd_um_max = chance.between(0.5, 50.0);
  config.compensation.suspected_sensors = config.compensation.estimate_lost_blocks
                                              ? SuspectedPolicy::weigh_down
                                              : SuspectedPolicy::warn;
  if (chance.one_in(2)) {
    config.correction.form =
        chance.one_in(2) ? CorrectionForm::recursive : CorrectionForm::two_phase;
    config.correction.groups = {{"t1_degC"}, {"t2_degC"}};
    config.correction.gain_sd = chance.between(0.05, 3.0);
    config.correction.step_um_max = chance.between(0.5, 100.0);
    config.correction.bias_drift_um_per_sqrt_h = chance.between(0.0, 20.0);
  }
  if (chance.one_in(8)) config.compensation.update = UpdateRule::each_cycle;
  config.compensation.outside_domain = static_cast<OutsidePolicy>(chance.below(3));
  return config;
}

ThermalModel random_model(Chance& chance) {
  ThermalModel model;
  model.inputs = {"t1_degC", "t2_degC", "t3_degC"};
  model.outputs = {"x_um", "y_um", "z_um"};
  const auto row = [&] {
    return std::vector<double>{chance.between(-9, 9), chance.between(-9, 9), chance.between(-9, 9)};
  };
  for (std::size_t i = 0; i < axes_count; ++i) model.matrix_um_per_K.push_back(row());
  if (chance.one_in(4)) model.reference_degC = {20.0, 21.0, 22.0};
  if (chance.one_in(2))
    model.guideways = {{"g", "y_mm", {0.0, 100.0, 500.0}, {{"z_um", {row(), row(), row()}}}}};
  if (chance.one_in(2))
    model.terms.push_back({"thermal_lag",
                           "t1_degC",
                           {{"tau_s", chance.one_in(2) ? 60.0 : 600.0}},
                           {{"gain_um_per_K", {{"x_um", chance.between(-5, 5)}}}}});
  if (chance.one_in(2))
    model.terms.push_back({"missing_heat_source",
                           "spindle_rpm",
                           {{"tau_s", 30.0}, {"power", 2.0}},
                           {{"gain_um_per_unit", {{"z_um", chance.between(-1e-6, 1e-6)}}}}});
  if (!chance.one_in(3)) add_covariance(chance, model);
  if (chance.one_in(2)) add_domain(chance, model);
  return model;
}

void lay_out_travel(Chance& chance, EstimatorConfig& config, ThermalModel& model) {
  const AxisConfig z = config.axes[2];
  const auto form = chance.one_in(2) ? TravelForm::line : TravelForm::table;
  config.axes[1] = config.axes[2] = z;
  config.axes[1].name = "z_1";
  config.axes[1].node = TravelNode{"z", "y_mm", -50.0, form};
  config.axes[2].name = "z_2";
  config.axes[2].node = TravelNode{"z", "y_mm", 500.0, form};
  if (!model.guideways.empty()) return;
  const auto row = [&] {
    return std::vector<double>{chance.between(-9, 9), chance.between(-9, 9), chance.between(-9, 9)};
  };
  model.guideways = {{"g", "y_mm", {0.0, 100.0, 500.0}, {{"z_um", {row(), row(), row()}}}}};
}

}  // namespace thermocomp::property
