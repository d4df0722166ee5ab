/// An axis moves to and fro at 10 m/min over a guideway whose rows differ by 40 um over 800 mm.
/// Remaining error at the tool if the daemon follows the position with an offset every 20 ms, and
/// if it sends a line or a table of nodes and the controller interpolates every 1 ms with its own
/// position.
///
/// Estimator and registers are the daemon's, the controller the simulator's. Time is virtual; the
/// link has no delay except its period: values read in one exchange are used in the next cycle and
/// the result is written in the next exchange. The peak covers motion at constant speed and turns,
/// after the offsets have settled.
///
/// The plain offset needs a slew limit above the speed of the displacement, here 40 um/s; its peak
/// is also printed for the limit of an axis moved by temperatures only, 0.5 um/s. Line and table
/// use it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"
#include "drivers/controllers/travel_values.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "simulator/devices/simulated_cnc.hpp"

namespace thermocomp {
namespace {

using std::chrono::milliseconds;

const std::vector<double> nodes_mm{0.0, 200.0, 400.0, 600.0, 800.0};
const std::vector<double> rows_um_per_K{0.0, 1.5, 2.5, 3.3, 4.0};
constexpr double warm_K = 10.0;
constexpr double speed_mm_per_ms = 10.0 / 60.0;  // 10 m/min
constexpr nanoseconds servo = milliseconds(1);
constexpr nanoseconds cycle = milliseconds(10);
constexpr nanoseconds exchange = milliseconds(20);
constexpr nanoseconds settled = std::chrono::seconds(200);  // of 40 um at 0.5 um/s
constexpr nanoseconds end = settled + std::chrono::seconds(40);

enum class Sent { number, line, table };

ThermalModel model() {
  ThermalModel bed;
  bed.inputs = {"bed_degC"};
  bed.outputs = {"x_um"};
  bed.reference_degC = {20.0};
  bed.matrix_um_per_K = {{0.0}};
  GuidewaySpec guideway{"bed", "x_mm", nodes_mm, {}};
  for (const double row : rows_um_per_K) guideway.rows_um_per_K["x_um"].push_back({row});
  bed.guideways = {guideway};
  return bed;
}

EstimatorConfig estimator_config(Sent sent, double rate_um_per_s) {
  EstimatorConfig config;
  SensorConfig sensor;
  sensor.name = "bed";
  sensor.smoothing.form = SmoothingForm::off;
  sensor.screening.settle_s = 0.0;
  config.sensors = {sensor};
  config.blocks = {{"bed", "bed_degC", {0}}};
  config.signals = {"x_mm"};
  config.compensation.enabled_at_first_start = true;
  const AxisConfig axis{"x", "x_um", 1.0, {60.0, rate_um_per_s}};
  if (sent == Sent::number) {
    config.axes = {axis};
    return config;
  }
  const auto form = sent == Sent::line ? TravelForm::line : TravelForm::table;
  const auto at_mm =
      sent == Sent::line ? std::vector<double>{nodes_mm.front(), nodes_mm.back()} : nodes_mm;
  for (const double position_mm : at_mm) {
    AxisConfig& node = config.axes.emplace_back(axis);
    node.name = "x_" + std::to_string(config.axes.size());
    node.node = TravelNode{"x", "x_mm", position_mm, form};
  }
  return config;
}

ModbusValue holding(std::size_t address, Encoding encoding, double scale) {
  ModbusValue value;
  value.address = static_cast<std::uint16_t>(address);
  value.encoding = encoding;
  value.scale = scale;
  return value;
}

ModbusTravel travel(Sent sent) {
  ModbusTravel registers;
  registers.nodes_mm = nodes_mm;
  if (sent == Sent::line) {
    registers.nodes_mm = {nodes_mm.front(), nodes_mm.back()};
    registers.p0_mm = 0.0;
  }
  registers.begin = holding(100, Encoding::uint16, 1.0);
  for (std::size_t i = 0; i < (sent == Sent::line ? 2 : nodes_mm.size()); ++i)
    registers.values.push_back(holding(101 + 2 * i, Encoding::int32, 0.001));
  registers.end = holding(101 + 2 * registers.values.size(), Encoding::uint16, 1.0);
  return registers;
}

SimulatedController controller(Sent sent) {
  SimulatedController config;
  SimulatedAxis& axis = config.axes.emplace_back();
  axis.name = "x";
  axis.output = "x_um";
  if (sent == Sent::number) return config;
  axis.travel = SimulatedTravel{travel(sent), "x_mm", 100.0};
  return config;
}

double position_mm(nanoseconds now) {
  const double way_mm =
      std::fmod(speed_mm_per_ms * std::chrono::duration<double, std::milli>(now).count(), 1600.0);
  return way_mm <= 800.0 ? way_mm : 1600.0 - way_mm;
}

double curve_um(double at_mm) {
  std::size_t above = 1;
  while (above + 1 < nodes_mm.size() && at_mm > nodes_mm[above]) ++above;
  const double share = (at_mm - nodes_mm[above - 1]) / (nodes_mm[above] - nodes_mm[above - 1]);
  return warm_K * ((1.0 - share) * rows_um_per_K[above - 1] + share * rows_um_per_K[above]);
}

/// The registers as read by the controller.
std::vector<double> through_registers(Sent sent, std::uint64_t number,
                                      std::span<const double> offset_um) {
  if (sent == Sent::number)
    return {encode(offset_um[0], {Encoding::int32, WordOrder::abcd, 0.001, 0.0}).value};
  const ModbusTravel set = travel(sent);
  const WriteField field = travel_field(set, number % travel_numbers(set), offset_um);
  std::vector<double> values;
  for (const ModbusValue& place : set.values)
    values.push_back(decode(std::span(field.words).subspan(place.address - set.begin.address),
                            {place.encoding, place.word_order, place.scale, 0.0}, {})
                         .value);
  std::vector<double> nodes_um(set.nodes_mm.size());
  offsets_shown(set, values, nodes_um);
  return nodes_um;
}

double peak_error_um(Sent sent, double rate_um_per_s) {
  const EstimatorConfig config = estimator_config(sent, rate_um_per_s);
  Estimator estimator(config, model());
  SimulatedCnc cnc(controller(sent));
  ControllerState read;
  read.online = true;
  read.written = true;
  read.link_epoch = 1;
  OffsetCommand command;
  std::uint64_t writes = 0;
  double peak_um = 0.0;
  for (nanoseconds now{}; now < end; now += servo) {
    const double at_mm = position_mm(now);
    const double now_s = std::chrono::duration<double>(now).count();
    if (now % exchange == nanoseconds{}) {
      const auto shown_um = cnc.nodes(0);
      std::copy(shown_um.begin(), shown_um.end(), read.applied_um.begin());
      read.signals[0] = at_mm;
      read.taken_at = now;
      ++read.read_back_number;
      if (command.valid[0])
        cnc.take(now_s, {through_registers(
                             sent, ++writes,
                             std::span<const double>(command.offset_um).first(config.axes.size())),
                         1, 0.0});
    }
    if (now % cycle == nanoseconds{}) {
      const Reading reading{20.0 + warm_K, now, Fault::none};
      estimator.step(now, {&reading, 1}, read, command);
    }
    cnc.step(now_s, {});
    if (sent != Sent::number) cnc.set_position(0, now_s, at_mm);
    if (now >= settled) peak_um = std::max(peak_um, std::abs(curve_um(at_mm) + cnc.applied_um(0)));
  }
  return peak_um;
}

}  // namespace
}  // namespace thermocomp

int main() {
  using thermocomp::Sent;
  std::printf("peak_error_number %.3f um\n", thermocomp::peak_error_um(Sent::number, 40.0));
  std::printf("peak_error_number_slew_of_temperatures %.3f um\n",
              thermocomp::peak_error_um(Sent::number, 0.5));
  std::printf("peak_error_line %.3f um\n", thermocomp::peak_error_um(Sent::line, 0.5));
  std::printf("peak_error_table %.3f um\n", thermocomp::peak_error_um(Sent::table, 0.5));
}
