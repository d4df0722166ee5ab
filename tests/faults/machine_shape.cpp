#include <string>

#include "drivers/modbus/modbus_config.hpp"
#include "machine.hpp"

namespace thermocomp::faults {
namespace {

constexpr std::uint16_t first_value_address = 10;
constexpr std::uint16_t value_stride = 4;

ModbusChannel channel_of(const UnitPlace& place, std::size_t index) {
  ModbusChannel channel;
  channel.sensor = place.sensors[index];
  channel.address = static_cast<std::uint16_t>(first_value_address + value_stride * index);
  if (place.floats) {
    channel.encoding = Encoding::float32;
    channel.word_order = place.words_low_first ? WordOrder::cdab : WordOrder::abcd;
  } else {
    channel.encoding = Encoding::int16;
    channel.scale = 0.01;
    channel.sentinels = {{32767, Fault::open_circuit}, {-32768, Fault::short_circuit}};
  }
  if (place.has_status) {
    channel.status = ModbusStatus{ModbusTable::input,
                                  static_cast<std::uint16_t>(channel.address + 2),
                                  0xFFFF,
                                  {{1, Fault::open_circuit}, {2, Fault::short_circuit}}};
  }
  return channel;
}

ModbusBusConfig bus_of(std::size_t bus, Chance& chance, double period_s) {
  ModbusBusConfig config;
  config.name = bus == 0 ? "tcp" : "serial";
  if (bus == 0)
    config.line.link = ModbusTcp{"machine", 502};
  else
    config.line.link = ModbusRtu{"/dev/ttyS0", 115200, 'E', 8, 1, false};
  config.line.timeout_ms = chance.between(60.0, 300.0);
  config.line.reconnect_s = chance.between(0.5, 2.0);
  config.line.backoff_s_max = chance.between(2.0, 20.0);
  config.line.retries = static_cast<int>(chance.below(3));
  for (const UnitPlace& place : unit_places()) {
    if (place.bus != bus) continue;
    ModbusDeviceConfig device;
    device.name = std::string("unit").append(1, static_cast<char>('0' + place.unit));
    device.unit = place.unit;
    device.period_s = period_s;
    device.one_register_a_request = !place.floats && chance.one_in(place.has_status ? 2 : 4);
    if (place.has_counter) device.renewal = ModbusRenewal{ModbusTable::input, 0};
    for (std::size_t i = 0; i < place.sensors.size(); ++i)
      device.channels.push_back(channel_of(place, i));
    config.devices.push_back(device);
  }
  return config;
}

ModbusControllerConfig controller_of(Chance& chance, bool floats, double period_s) {
  ModbusControllerConfig config;
  config.name = "cnc";
  config.line.link = ModbusTcp{"cnc", 502};
  config.line.timeout_ms = chance.between(60.0, 300.0);
  config.line.reconnect_s = chance.between(0.3, 1.0);
  config.line.retries = static_cast<int>(chance.below(2));
  config.period_s = period_s;
  const std::uint16_t words = floats ? 2 : 1;
  const auto value = [&](std::uint16_t address) {
    return floats
               ? ModbusValue{ModbusTable::holding, address, Encoding::float32}
               : ModbusValue{ModbusTable::holding, address, Encoding::int16, WordOrder::abcd, 0.1};
  };
  for (std::uint16_t axis = 0; axis < axes_count; ++axis) {
    config.axes.push_back({value(static_cast<std::uint16_t>(200 + words * axis)),
                           value(static_cast<std::uint16_t>(100 + words * axis))});
  }
  const auto raw = [](std::uint16_t address) {
    return ModbusValue{ModbusTable::holding, address, Encoding::uint16};
  };
  config.signals = {{0, raw(106)}, {1, raw(107)}};
  config.valid_bits = raw(static_cast<std::uint16_t>(200 + words * axes_count));
  config.heartbeat = raw(static_cast<std::uint16_t>(201 + words * axes_count));
  return config;
}

/// Correction of the model, and whether the offset waits for cycle ends.
void draw_correction(Chance& chance, EstimatorConfig& estimator) {
  CorrectionConfig& correction = estimator.correction;
  correction.form = chance.one_in(2) ? CorrectionForm::two_phase : CorrectionForm::recursive;
  correction.groups = {{"t1_degC"}, {"t2_degC", "t3_degC"}};
  correction.measured = chance.one_in(2) ? MeasuredMeaning::remaining : MeasuredMeaning::total;
  if (chance.one_in(4)) correction.first_gain = FirstGain::eq_34;
  correction.noise_um = chance.between(0.2, 2.0);
  correction.step_um_max = chance.between(1.0, 8.0);
  correction.gain_min = chance.between(0.2, 0.8);
  correction.gain_max = chance.between(1.2, 3.0);
  if (chance.one_in(2)) correction.bias_drift_um_per_sqrt_h = chance.between(1.0, 10.0);
  CompensationConfig& compensation = estimator.compensation;
  if (!chance.one_in(4)) return;
  compensation.update = UpdateRule::each_cycle;
  compensation.cycles_per_update = 1 + chance.below(3);
  compensation.cycle_ahead = chance.one_in(2) ? 1.0 : 0.0;
  // A workpiece ends when cutting stops.
  if (chance.one_in(2)) compensation.cycle_end_signal = "cutting_on";
}

/// Treatment of suspected sensors and lost blocks.
void draw_suspicion(Chance& chance, EstimatorConfig& estimator, ThermalModel& model) {
  const double own_K2 = chance.between(0.01, 0.3);
  for (std::size_t i = 0; i < model.inputs.size(); ++i)
    model.covariance_K2.emplace_back(model.inputs.size(), 4.0)[i] += own_K2;
  if (chance.one_in(2)) model.covariance_growth.drift_time_s = chance.between(600.0, 36000.0);
  estimator.compensation.suspected_sensors =
      chance.one_in(4) ? SuspectedPolicy::warn : SuspectedPolicy::weigh_down;
  estimator.compensation.offset_sd_um_max = chance.between(0.2, 20.0);
}

/// Second and third axis as two nodes of one travel: registers, position, model.
void lay_out_travel(MachineShape& shape, Chance& chance) {
  ModbusControllerConfig& controller = shape.controller;
  const ModbusValue x = controller.axes[0].offset;
  std::uint16_t next = x.address;
  const auto take = [&next](ModbusValue value) {
    value.address = next;
    next = static_cast<std::uint16_t>(next + registers_of(value.encoding));
    return value;
  };
  const ModbusValue number{ModbusTable::holding, 0, Encoding::uint16};
  controller.axes[0].offset = take(x);
  ModbusTravel travel;
  travel.nodes_mm = {0.0, 500.0};
  travel.begin = take(number);
  for (std::size_t node = 1; node < axes_count; ++node) {
    travel.values.push_back(take(x));
    travel.applied.push_back(*controller.axes[node].applied);
  }
  travel.end = take(number);
  controller.axes.resize(1);
  controller.axes.emplace_back().travel = travel;
  controller.valid_bits = take(number);
  controller.heartbeat = take(number);
  controller.signals.push_back({2, {ModbusTable::holding, 108, Encoding::uint16}});
  shape.estimator.signals.emplace_back("y_mm");
  const AxisConfig y = shape.estimator.axes[1];
  for (std::size_t node = 1; node < axes_count; ++node) {
    AxisConfig& axis = shape.estimator.axes[node];
    axis = y;
    axis.name = node == 1 ? "y_1" : "y_2";
    axis.node = TravelNode{"y", "y_mm", travel.nodes_mm[node - 1], TravelForm::table};
  }
  const auto row = [&chance] {
    return std::vector<double>{chance.between(-6.0, 6.0), chance.between(-6.0, 6.0),
                               chance.between(-6.0, 6.0)};
  };
  shape.model.guideways = {{"y", "y_mm", {0.0, 500.0}, {{"y_um", {row(), row()}}}}};
}

std::vector<std::vector<double>> random_matrix(Chance& chance) {
  std::vector<std::vector<double>> rows(axes_count);
  for (auto& row : rows)
    for (std::size_t i = 0; i < 3; ++i) row.push_back(chance.between(-6.0, 6.0));
  return rows;
}

}  // namespace

const std::array<UnitPlace, units_count>& unit_places() {
  static const std::array<UnitPlace, units_count> places{
      UnitPlace{0, 1, {0, 1}, true, true, true, false},
      UnitPlace{0, 2, {2, 3}, false, false, false, false},
      UnitPlace{1, 1, {4, 5}, false, false, false, true},
      UnitPlace{1, 2, {6}, true, false, false, false}};
  return places;
}

std::size_t unit_of(std::size_t sensor) {
  const auto& places = unit_places();
  const auto found = std::find_if(places.begin(), places.end(), [&](const UnitPlace& place) {
    return std::find(place.sensors.begin(), place.sensors.end(), sensor) != place.sensors.end();
  });
  return static_cast<std::size_t>(found - places.begin());
}

MachineShape::MachineShape(std::uint64_t seed, double cycle_hz) {
  Chance chance(seed, 1);
  offsets_are_float = chance.one_in(2);
  const double slowest_s = cycle_hz > 10.0 ? 0.5 : 1.0;
  for (std::size_t bus = 0; bus < buses_count; ++bus) buses[bus] = bus_of(bus, chance, slowest_s);
  controller = controller_of(chance, offsets_are_float, cycle_hz > 10.0 ? 0.1 : 0.5);
  const bool smooth = chance.one_in(2);
  for (std::size_t i = 0; i < sensors_count; ++i) {
    SensorConfig sensor;
    sensor.name = std::string("s").append(1, static_cast<char>('1' + i));
    sensor.module = std::string("unit").append(1, static_cast<char>('1' + unit_of(i)));
    sensor.screening.rate_K_per_s_max = 0.5;
    sensor.screening.stale_after_s = chance.between(2.5, 8.0);
    sensor.screening.stuck_after_s = chance.one_in(2) ? chance.between(20.0, 60.0) : 0.0;
    sensor.smoothing.form = smooth ? SmoothingForm::sliding_line : SmoothingForm::off;
    sensor.smoothing.period_s = 0.0;
    sensor.smoothing.samples = 5;
    sensor.smoothing.outage_s = 20.0;
    estimator.sensors.push_back(sensor);
  }
  estimator.blocks = {
      {"b1", "t1_degC", {0, 4}}, {"b2", "t2_degC", {1, 2}}, {"b3", "t3_degC", {3, 5, 6}}};
  estimator.signals = {"cutting_on", "compensation_off_on"};
  const std::array<const char*, axes_count> names{"x", "y", "z"};
  const std::array<const char*, axes_count> outputs{"x_um", "y_um", "z_um"};
  for (std::size_t i = 0; i < axes_count; ++i)
    estimator.axes.push_back({names[i],
                              outputs[i],
                              chance.one_in(2) ? 1.0 : -1.0,
                              {chance.between(8.0, 80.0), chance.between(0.2, 3.0)}});
  CompensationConfig& compensation = estimator.compensation;
  compensation.on_loss = chance.one_in(2) ? LossPolicy::hold : LossPolicy::ramp_to_zero;
  compensation.hold_s = chance.between(1.0, 60.0);
  compensation.cutting_signal = "cutting_on";
  compensation.hold_while_cutting = chance.one_in(3);
  compensation.disable_signal = "compensation_off_on";
  compensation.enabled_at_first_start = true;
  compensation.mismatch_um = chance.between(1.0, 3.0);
  compensation.mismatch_after_s = chance.between(1.0, 4.0);
  model.inputs = {"t1_degC", "t2_degC", "t3_degC"};
  model.outputs = {"x_um", "y_um", "z_um"};
  model.matrix_um_per_K = random_matrix(chance);
  if (chance.one_in(3)) model.reference_degC = {20.0, 21.0, 22.0};
  if (judges_sensors(seed)) {
    Chance own(seed, 11);
    draw_suspicion(own, estimator, model);
  }
  if (waits_long(seed)) {
    controller.line.timeout_ms = 3000.0;
    compensation.controller_stale_after_s = 15.0;
  }
  if (interpolates(seed)) {
    Chance own(seed, 12);
    lay_out_travel(*this, own);
  }
  if (!reads_back(seed)) {
    Chance own(seed, 13);
    estimator.controller_reads_back = false;
    compensation.restart_leap_um_max = own.between(0.3, 2.0);
    for (ModbusAxis& axis : controller.axes) {
      axis.applied.reset();
      if (axis.travel) axis.travel->applied.clear();
    }
  }
  if (!corrects_itself(seed)) return;
  Chance own(seed, 9);
  draw_correction(own, estimator);
}

ThermalModel MachineShape::offered_model(Chance& chance) const {
  ThermalModel offered = model;
  offered.matrix_um_per_K = random_matrix(chance);
  return offered;
}

void MachineShape::change_for_reload(Chance& chance) {
  for (AxisConfig& axis : estimator.axes)
    axis.limiter = {chance.between(8.0, 80.0), chance.between(0.2, 3.0)};
  if (chance.one_in(2)) model.matrix_um_per_K = random_matrix(chance);
  CompensationConfig& compensation = estimator.compensation;
  compensation.on_loss = chance.one_in(2) ? LossPolicy::hold : LossPolicy::ramp_to_zero;
  compensation.hold_s = chance.between(1.0, 60.0);
  compensation.hold_while_cutting = chance.one_in(3);
  if (estimator.correction.form != CorrectionForm::off && chance.one_in(2))
    estimator.correction.step_um_max = chance.between(1.0, 8.0);
}

}  // namespace thermocomp::faults
