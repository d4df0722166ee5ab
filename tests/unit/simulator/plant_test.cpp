// Tests of the simulated body: heat balance, and values independent of the reading times.
#include "simulator/plant/plant.hpp"

#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "simulator/plant/machine_config.hpp"
#include "simulator/plant/simulate.hpp"
#include "simulator/plant/thermal_network.hpp"

using namespace thermocomp;

namespace {

SignalConfig constant(const std::string& name, double value) {
  SignalConfig signal;
  signal.name = name;
  signal.times_s = {0.0};
  signal.values = {value};
  return signal;
}

/// Two lumps in a row, the first heated: spindle - column - room.
PlantConfig two_lumps() {
  PlantConfig plant;
  plant.room.mean_degC = 20.0;
  plant.signals = {constant("spindle_rpm", 8000.0)};
  plant.outputs = {{"z_um", 0.0}};
  plant.nodes = {{"spindle", "a", 5000.0, 0.0, 0.0, {{"z_um", 2.0}}},
                 {"column", "b", 40000.0, 10.0, 0.0, {{"z_um", 3.0}}}};
  plant.links = {{0, 1, 20.0}};
  plant.sources = {{0, 0, 100.0, 8000.0, 1.5}};
  return plant;
}

/// A plant with every stateful and random part.
PlantConfig lively() {
  PlantConfig plant = two_lumps();
  plant.signals.push_back({"feed_mm_per_min",
                           SignalKind::random,
                           {},
                           {0.0, 1000.0, 3000.0},
                           0.0,
                           30.0,
                           200.0,
                           0.0,
                           0.0,
                           60.0,
                           0,
                           0.0});
  plant.signals.push_back({"coolant_on",
                           SignalKind::steps,
                           {0.0, 300.0, 700.0},
                           {0.0, 1.0, 0.0},
                           1000.0,
                           0.0,
                           0.0,
                           0.0,
                           0.0,
                           60.0,
                           0,
                           0.0});
  plant.sources.push_back({1, 1, 50.0, 3000.0, 1.0});
  plant.nodes[1].coolant_W_per_K = 30.0;
  plant.coolant = {2, 18.0, 0.5};
  plant.room.daily_swing_K = 3.0;
  plant.room.wander_K = 0.5;
  plant.thermocouples.resize(2);
  plant.thermocouples[0].name = "spindle";
  plant.thermocouples[0].noise_K = 0.05;
  plant.thermocouples[0].lag_s = 15.0;
  plant.thermocouples[1].name = "room";
  plant.thermocouples[1].place = ThermocoupleConfig::Place::room;
  plant.thermocouples[1].noise_K = 0.05;
  return plant;
}

std::vector<double> row_at(Plant& plant, double time_s) {
  std::vector<double> row(plant.columns().size());
  plant.advance_to(time_s);
  plant.row(row);
  return row;
}

}  // namespace

TEST_CASE("a body without losses conserves energy") {
  PlantConfig config = two_lumps();
  config.nodes[1].room_W_per_K = 0.0;
  Plant plant(config, 1);
  plant.advance_to(5000.0);
  const double stored_J =
      5000.0 * (plant.node_degC(0) - 20.0) + 40000.0 * (plant.node_degC(1) - 20.0);
  CHECK(stored_J == Approx(100.0 * 5000.0).epsilon(1e-9));
}

TEST_CASE("the steady state matches the manual calculation") {
  Plant plant(two_lumps(), 1);
  plant.advance_to(3.0e5);
  // 100 W leave through 10 W/K to the room and cross 20 W/K on their way.
  CHECK(plant.node_degC(1) == Approx(30.0).epsilon(1e-6));
  CHECK(plant.node_degC(0) == Approx(35.0).epsilon(1e-6));
  CHECK(plant.displacement_um(0) == Approx(2.0 * 15.0 + 3.0 * 10.0).epsilon(1e-6));
}

TEST_CASE("one lump warms exponentially, at any step") {
  const double dt_s = GENERATE(1.0, 37.0, 5000.0, 1e7);
  const ThermalNetwork network(std::vector{2000.0}, std::vector{4.0});
  std::vector<double> temp{10.0};
  network.advance(dt_s, std::vector{100.0}, temp);
  CHECK(temp[0] == Approx(25.0 - 15.0 * std::exp(-dt_s / 500.0)));
}

TEST_CASE("heat depends on the speed by the source's exponent") {
  PlantConfig config = two_lumps();
  config.signals = {constant("spindle_rpm", 4000.0)};
  CHECK(Plant(config, 1).heat_W(0) == Approx(100.0 * std::pow(0.5, 1.5)));
}

TEST_CASE("coolant cools only while it flows") {
  PlantConfig config = two_lumps();
  config.nodes[1].coolant_W_per_K = 50.0;
  config.coolant.temp_degC = 20.0;
  Plant never(config, 1);
  config.signals.push_back(constant("coolant_on", 1.0));
  config.coolant.signal = 1;
  Plant always(config, 1);
  never.advance_to(3.0e5);
  always.advance_to(3.0e5);
  CHECK(never.node_degC(1) == Approx(30.0).epsilon(1e-6));
  CHECK(always.node_degC(1) == Approx(20.0 + 100.0 / 60.0).epsilon(1e-6));
}

TEST_CASE("values at a time do not depend on earlier reading times") {
  Plant seldom(lively(), 7);
  Plant often(lively(), 7);
  for (double t = 0.0; t < 2000.0; t += 0.37) often.advance_to(t);
  CHECK(row_at(often, 2000.5) == row_at(seldom, 2000.5));
}

TEST_CASE("a shorter step of the plant changes little") {
  PlantConfig fine = lively();
  fine.room.wander_K = 0.0;  // its random numbers depend on the step
  PlantConfig coarse = fine;
  fine.step_s = 0.1;
  coarse.step_s = 10.0;
  Plant a(fine, 3);
  Plant b(coarse, 3);
  a.advance_to(5000.0);
  b.advance_to(5000.0);
  CHECK(a.node_degC(0) == Approx(b.node_degC(0)).margin(0.1));
  CHECK(a.displacement_um(0) == Approx(b.displacement_um(0)).margin(0.3));
}

TEST_CASE("the run depends on the seed, and only on it") {
  MachineConfig machine;
  machine.plant = lively();
  machine.pitch_s = 5.0;
  const RunFile a = simulate(machine, 3600.0, 5);
  CHECK(a.values == simulate(machine, 3600.0, 5).values);
  CHECK(a.values != simulate(machine, 3600.0, 6).values);
  CHECK(a.rows() == 721);
  CHECK(a.columns == std::vector<std::string>{"time_s", "spindle_rpm", "feed_mm_per_min",
                                              "coolant_on", "spindle_degC", "room_degC", "z_um"});
}

TEST_CASE("a thermocouple shows its node with noise of the stated size, lag, offset, resolution") {
  PlantConfig config = two_lumps();
  config.sources.clear();  // no heat
  config.thermocouples.resize(2);
  config.thermocouples[0].noise_K = 0.05;
  config.thermocouples[1].offset_K = 0.333;
  config.thermocouples[1].resolution_K = 0.1;
  Plant plant(config, 11);
  double sum = 0.0;
  double squares = 0.0;
  constexpr int n = 4000;
  for (int i = 0; i < n; ++i) {
    plant.advance_to(i);
    const double error = plant.thermocouple_degC(0) - 20.0;
    sum += error;
    squares += error * error;
  }
  CHECK(sum / n == Approx(0.0).margin(0.004));
  CHECK(std::sqrt(squares / n) == Approx(0.05).epsilon(0.05));
  CHECK(plant.thermocouple_degC(1) == Approx(20.3).margin(1e-9));
}

TEST_CASE("a lagging thermocouple trails a steady rise by slope times lag") {
  PlantConfig config = two_lumps();
  config.nodes.resize(1);
  config.links.clear();  // 100 W into 5000 J/K: a constant 0.02 K/s
  config.thermocouples.resize(1);
  config.thermocouples[0].lag_s = 30.0;
  Plant plant(config, 1);
  plant.advance_to(1000.3);
  CHECK(plant.node_degC(0) - plant.thermocouple_degC(0) == Approx(0.02 * 30.0).epsilon(1e-3));
}

TEST_CASE("a position effect is zero at its centre and linear beside it") {
  PlantConfig config = two_lumps();
  config.signals.push_back(constant("x_mm", 450.0));
  Plant without(config, 1);
  config.position_effects = {{0, 0, 1, 250.0, 3.0}};
  Plant with(config, 1);
  without.advance_to(3.0e5);
  with.advance_to(3.0e5);
  CHECK(with.displacement_um(0) - without.displacement_um(0) == Approx(3.0 * 15.0 * 0.2));
}

TEST_CASE("a line is linear between its values and restarts when it repeats") {
  PlantConfig config = two_lumps();
  SignalConfig line = constant("oil", 0.0);
  line.kind = SignalKind::line;
  line.times_s = {0.0, 100.0, 300.0};
  line.values = {20.0, 40.0, 30.0};
  config.signals.push_back(line);
  Plant once(config, 1);
  config.signals.back().repeat_s = 400.0;
  Plant again(config, 1);
  const std::vector<std::pair<double, double>> seen{{0, 20},   {50, 30},  {100, 40},
                                                    {200, 35}, {300, 30}, {350, 30}};
  for (const auto& [time_s, value] : seen) {
    once.advance_to(time_s);
    again.advance_to(time_s);
    CHECK(once.signal(1) == Approx(value));
    CHECK(again.signal(1) == Approx(value));
  }
  once.advance_to(450.0);
  again.advance_to(450.0);
  CHECK(once.signal(1) == Approx(30.0));
  CHECK(again.signal(1) == Approx(30.0));  // 50 s into the second round
  again.advance_to(475.0);
  CHECK(again.signal(1) == Approx(35.0));
}

TEST_CASE("a coolant temperature given by a signal does not depend on the room") {
  PlantConfig config = two_lumps();
  config.sources.clear();
  config.nodes[0].coolant_W_per_K = 1e6;
  config.signals.push_back(constant("pump_on", 1.0));
  config.signals.push_back(constant("oil", 43.0));
  config.coolant.signal = 1;
  config.coolant.temp_signal = 2;
  Plant plant(config, 1);
  plant.advance_to(1000.0);
  CHECK(plant.node_degC(0) == Approx(43.0).margin(0.01));
}

TEST_CASE("a body's guideway adds its rows at the axis' position to the output") {
  PlantConfig config;
  config.room = {20.0, 0.0, 15.0, 7.0, 0.0, 3600.0, {}};
  config.signals = {constant("z_mm", 0.0), constant("warm", 1.0)};
  config.signals[0].kind = SignalKind::line;
  config.signals[0].times_s = {0.0, 1e6, 2e6};
  config.signals[0].values = {-100.0, 50.0, 900.0};
  ReducedBody body;
  body.conductance = {1e-3};
  body.coolant_conductance = {0.0};
  body.room_inflow = {1e-3};
  body.coolant_inflow = {0.0};
  body.one_degC = {1.0};
  body.sources = {{"heat", "warm", 1.0, 1.0, 1.0, {1e-2}}};  // 10 K in steady state
  body.sensors = {{"there", {1.0}}};
  body.outputs = {{"x_um", {2.0}}};
  body.guideways = {{"rail", "z_mm", "x_um", {0.0, 100.0, 800.0}, {{-1.0}, {1.0}, {3.0}}}};
  config.body = body;
  config.body_signals = {1};
  config.body_outputs = {0};
  config.body_axes = {0};
  config.outputs = {{"x_um", 0.0}};
  Plant plant(config, 1);
  CHECK(plant.displacement_um(0) == 0.0);  // nothing is warm yet
  plant.advance_to(1e5);
  CHECK(plant.displacement_um(0) == Approx(10.0 * (2.0 - 1.0)));  // below its first position
  plant.advance_to(1e6);
  CHECK(plant.displacement_um(0) == Approx(10.0 * (2.0 + 0.0)));  // at 50 mm
  plant.advance_to(2e6);
  CHECK(plant.displacement_um(0) == Approx(10.0 * (2.0 + 3.0)));
  const ReducedBody read = parse_body(write_body(body, ""), "body.toml");
  REQUIRE(read.guideways.size() == 1);
  CHECK(read.guideways[0].output == "x_um");
  CHECK(read.guideways[0].positions_mm == body.guideways[0].positions_mm);
  CHECK(read.guideways[0].rows == body.guideways[0].rows);
}

TEST_CASE("the room follows the clock and the draught") {
  PlantConfig config = two_lumps();
  config.room = {20.0, 2.0, 15.0, 7.0, 0.0, 3600.0, {{3600.0, 60.0, -5.0}}};
  Plant plant(config, 1);
  CHECK(plant.room_degC() == Approx(20.0 + 2.0 * std::cos(8.0 / 24.0 * 2.0 * M_PI)));
  plant.advance_to(3630.0);
  CHECK(plant.room_degC() < 20.0 - 5.0);
  plant.advance_to(8 * 3600.0);
  CHECK(plant.room_degC() == Approx(22.0));
}

TEST_CASE("random signals take only the given values for the given times") {
  PlantConfig config = lively();
  Plant plant(config, 9);
  double since_s = 0.0;
  double value = plant.signal(1);
  int changes = 0;
  for (double t = 0.0; t < 20000.0; t += 1.0) {
    plant.advance_to(t);
    const double now = plant.signal(1);
    CHECK((now == 0.0 || now == 1000.0 || now == 3000.0));
    if (now == value) continue;
    CHECK(t - since_s >= 29.0);
    value = now;
    since_s = t;
    ++changes;
  }
  CHECK(changes > 30);
}

TEST_CASE("the block matrix is the sum over the lumps of a block") {
  PlantConfig config = two_lumps();
  config.nodes.push_back({"hidden", "b", 1.0, 0.0, 0.0, {{"z_um", 0.5}}});
  CHECK(block_matrix(config, {"b", "a"}) == std::vector<std::vector<double>>{{3.5, 2.0}});
}
