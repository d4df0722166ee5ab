/// Update once per machining cycle, and the held state between.
#include <catch2/catch.hpp>

#include "estimator/pipeline/targets.hpp"
#include "small_machine.hpp"

using namespace thermocomp;

namespace {

/// Every cycle, one interval ahead, heat source and tie, probed as total displacement.
EstimatorConfig gate_config() {
  EstimatorConfig config = small_config();
  config.compensation.update = UpdateRule::each_cycle;
  config.compensation.cycle_ahead = 1.0;
  config.correction.form = CorrectionForm::two_phase;
  config.correction.groups = {{"t1_degC"}, {"t2_degC"}};
  config.correction.measured = MeasuredMeaning::total;
  config.correction.step_um_max = 50.0;
  config.correction.turn_um = 2.0;
  return config;
}

/// displacement = 4 (thA - thB) - 2 thC, with (thA - thB) as t1 and thC as t2.
ThermalModel gate_model() {
  ThermalModel model = small_model();
  model.matrix_um_per_K = {{4.0, -2.0}};
  return model;
}

/// The published guideway: rows of 1, 3 and 5 um/K over 800 mm.
ThermalModel guideway_model() {
  ThermalModel model = small_model();
  model.matrix_um_per_K = {{0.0, 0.0}};
  model.guideways = {
      {"bed", "x_mm", {0.0, 400.0, 800.0}, {{"z_um", {{1.0, 0.0}, {3.0, 0.0}, {5.0, 0.0}}}}}};
  return model;
}

EstimatorConfig guideway_config() {
  EstimatorConfig config = small_config();
  config.compensation.update = UpdateRule::each_cycle;
  config.signals.push_back("x_mm");
  return config;
}

/// The temperatures have settled when the cycle ends, and the offset when the next one begins.
void end_cycle(Machine& machine, const std::vector<double>& temps_degC) {
  machine.steps(5, temps_degC);
  machine.estimator.apply({CommandKind::cycle_end, 0, 0.0});
  machine.steps(20, temps_degC);
}

void probe(Machine& machine, double measured_um, const std::vector<double>& temps_degC) {
  machine.estimator.apply({CommandKind::measured, 0, measured_um});
  machine.step(temps_degC);
}

}  // namespace

TEST_CASE("each_cycle: the offset changes at cycle ends only", "[cycle_hold][estimator]") {
  EstimatorConfig config = small_config();
  config.compensation.update = UpdateRule::each_cycle;
  Machine machine(config);
  machine.step({20.0, 30.0});
  machine.steps(10, {21.0, 31.0});
  CHECK(machine.offset_um() == 0.0);
  machine.estimator.apply({CommandKind::cycle_end, 0, 0.0});
  machine.steps(10, {21.0, 31.0});
  CHECK(machine.offset_um() == -6.0);
  machine.steps(10, {23.0, 31.0});
  CHECK(machine.offset_um() == -6.0);
  machine.estimator.apply({CommandKind::cycle_end, 0, 0.0});
  machine.steps(10, {23.0, 31.0});
  CHECK(machine.offset_um() == -16.0);
}

TEST_CASE("a rising coil, a changing counter, and every n-th of them end a cycle", "[cycle_hold]") {
  CycleEnds coil(1, true);
  for (const double value : {1.0, 1.0, 0.0, not_a_number, 0.0}) coil.signal(value);
  CHECK(coil.count() == 0);  // 1 at the daemon's start ends no cycle
  coil.signal(1.0);
  CHECK(coil.count() == 1);
  CHECK(coil.take(false) == false);
  CHECK(coil.take(true));
  CHECK_FALSE(coil.take(true));
  CycleEnds counter(3, false);
  for (const double value : {7.0, 8.0, 8.0, 9.0}) counter.signal(value);
  CHECK_FALSE(counter.take(true));
  counter.command();
  CHECK(counter.take(true));
}

TEST_CASE("one cycle ahead, temperatures are extrapolated and the gains are the present ones",
          "[cycle_hold][estimator]") {
  Machine machine(gate_config(), gate_model());
  machine.step({20.0, 20.0});
  end_cycle(machine, {21.0, 20.0});
  CHECK(machine.offset_um() == Approx(-4.0));  // the first change is not known yet
  machine.step({22.0, 20.0});
  end_cycle(machine, {22.0, 20.0});
  CHECK(machine.offset_um() == Approx(-12.0));  // 2 K, and 1 K more until the next end
  machine.step({22.0, 20.0});
  end_cycle(machine, {22.0, 20.0});
  CHECK(machine.offset_um() == Approx(-8.0));
}

TEST_CASE("a gain corrected by a probing is not extrapolated", "[cycle_hold][estimator]") {
  Machine machine(gate_config(), gate_model());
  machine.step({20.0, 20.0});
  // Phase 1, temperatures constant: model 10, measured 12, and the next offset is -12.
  for (int i = 0; i < 2; ++i) end_cycle(machine, {22.5, 20.0});
  CHECK(machine.offset_um() == Approx(-10.0));
  probe(machine, 12.0, {22.5, 20.0});
  end_cycle(machine, {22.5, 20.0});
  CHECK(machine.offset_um() == Approx(-12.0));
  // Phase 2: the tie is warm, model 1.2 x 10 - 4 = 8, measured 6.4.
  for (int i = 0; i < 2; ++i) end_cycle(machine, {22.5, 22.0});
  CHECK(machine.offset_um() == Approx(-8.0));
  probe(machine, 6.4, {22.5, 22.0});
  CHECK(machine.report().axes[0].correction.phase == 2);
  end_cycle(machine, {22.5, 22.0});
  CHECK(machine.offset_um() == Approx(-6.4));
}

TEST_CASE("a reloaded matrix applies to the held temperatures and is not extrapolated",
          "[cycle_hold][estimator]") {
  Machine machine(gate_config(), gate_model());
  machine.step({20.0, 20.0});
  for (int i = 0; i < 2; ++i) end_cycle(machine, {22.5, 20.0});
  ThermalModel better = gate_model();
  better.matrix_um_per_K = {{4.8, -2.0}};
  reload(machine, gate_config(), better);
  machine.steps(20, {22.5, 20.0});
  CHECK(machine.offset_um() == Approx(-12.0));
  end_cycle(machine, {22.5, 20.0});
  CHECK(machine.offset_um() == Approx(-12.0));
}

TEST_CASE("temperatures are held between cycle ends, the position is not",
          "[cycle_hold][estimator]") {
  Machine machine(guideway_config(), guideway_model());
  machine.controller.signals[3] = 0.0;
  machine.step({20.0, 20.0});
  end_cycle(machine, {30.0, 20.0});
  CHECK(machine.offset_um() == Approx(-10.0));
  machine.controller.signals[3] = 800.0;
  machine.steps(20, {35.0, 20.0});
  CHECK(machine.offset_um() == Approx(-50.0));  // 10 K held, at the far end
  machine.controller.signals[3] = 400.0;
  machine.steps(20, {40.0, 20.0});
  CHECK(machine.offset_um() == Approx(-30.0));
  end_cycle(machine, {31.0, 20.0});
  CHECK(machine.offset_um() == Approx(-33.0));
}

TEST_CASE("a lag is constant between cycle ends, and goes an interval ahead if configured",
          "[cycle_hold][estimator]") {
  const auto ahead = GENERATE(0.0, 1.0);
  ThermalModel model = gate_model();
  model.terms = {
      {"thermal_lag", "t1_degC", {{"tau_s", 100.0}}, {{"gain_um_per_K", {{"z_um", 4.0}}}}}};
  EstimatorConfig config = gate_config();
  config.correction.form = CorrectionForm::off;
  config.compensation.cycle_ahead = ahead;
  Machine machine(config, model);
  Machine live(small_config(), model);
  for (Machine* each : {&machine, &live}) {
    each->step({20.0, 20.0});
    each->steps(5, {22.0, 20.0});
  }
  for (int cycle = 0; cycle < 3; ++cycle) {
    // One interval of 60 s: the cycle ends in its first second.
    machine.estimator.apply({CommandKind::cycle_end, 0, 0.0});
    for (Machine* each : {&machine, &live}) each->steps(1, {22.0, 20.0});
    const double now_um = live.report().displacement_um[0];
    for (Machine* each : {&machine, &live}) each->steps(59, {22.0, 20.0});
    if (ahead == 0.0) CHECK(machine.offset_um() == Approx(-now_um));
  }
  machine.estimator.apply({CommandKind::cycle_end, 0, 0.0});
  for (Machine* each : {&machine, &live}) each->step({22.0, 20.0});
  machine.steps(59, {22.0, 20.0});
  live.steps(ahead == 0.0 ? 0 : 60, {22.0, 20.0});
  CHECK(machine.offset_um() == Approx(-live.report().displacement_um[0]).epsilon(1e-9));
}

TEST_CASE("a new reference is the held state from then on", "[cycle_hold][estimator]") {
  Machine machine(gate_config(), gate_model());
  machine.step({20.0, 20.0});
  for (int i = 0; i < 2; ++i) end_cycle(machine, {22.5, 20.0});
  machine.estimator.apply({CommandKind::reference, 0, 0.0});
  machine.steps(20, {23.0, 20.0});
  CHECK(machine.offset_um() == 0.0);
  end_cycle(machine, {23.0, 20.0});
  CHECK(machine.offset_um() == Approx(-2.0));
}

TEST_CASE("the held state survives a restart, at any position", "[cycle_hold][estimator]") {
  Machine machine(guideway_config(), guideway_model());
  machine.controller.signals[3] = 0.0;
  machine.step({20.0, 20.0});
  end_cycle(machine, {30.0, 20.0});
  PersistentState state;
  state.reference_degC = {{"t1_degC", 20.0}, {"t2_degC", 20.0}};
  state.offset_um = {{"z", machine.offset_um()}};
  for (std::size_t i = 0; i < 2; ++i)
    state.held_degC[i == 0 ? "t1_degC" : "t2_degC"] = machine.report().inputs[i].held_degC;
  CHECK(std::isnan(machine.report().signals[0].held));
  Machine next(guideway_config(), guideway_model());
  next.controller = machine.controller;
  next.estimator.restore(state);
  next.controller.signals[3] = 400.0;
  next.steps(20, {33.0, 20.0});
  CHECK(next.offset_um() == Approx(-30.0));
}

TEST_CASE("an incomplete state is not held: the offset stays until the next cycle end",
          "[cycle_hold][estimator]") {
  Machine machine(guideway_config(), guideway_model());
  PersistentState state;
  state.reference_degC = {{"t1_degC", 20.0}, {"t2_degC", 20.0}};
  state.offset_um = {{"z", -7.0}};
  state.held_degC = {{"t1_degC", 30.0}};
  machine.controller.applied_um[0] = -7.0;
  machine.controller.signals[3] = 0.0;
  machine.estimator.restore(state);
  machine.steps(20, {33.0, 20.0});
  CHECK(machine.offset_um() == -7.0);
  end_cycle(machine, {33.0, 20.0});
  CHECK(machine.offset_um() == Approx(-13.0));
}

TEST_CASE("an edge of the cycle's signal during a reload is not lost", "[cycle_hold]") {
  CycleEnds before(1, true);
  before.signal(0.0);
  CycleEnds after(1, true);
  after.adopt(before, true);
  after.signal(1.0);
  CHECK(after.count() == 1);
  CycleEnds of_another_signal(1, true);
  of_another_signal.adopt(before, false);
  of_another_signal.signal(1.0);
  CHECK(of_another_signal.count() == 0);
}
