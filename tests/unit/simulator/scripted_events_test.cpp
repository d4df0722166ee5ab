// Tests of scripted events and of the simulated controller's response to offsets.
#include "simulator/plant/scripted_events.hpp"

#include <cmath>

#include <catch2/catch.hpp>

#include "simulator/devices/simulated_cnc.hpp"

using namespace thermocomp;

namespace {

MachineConfig one_device() {
  MachineConfig machine;
  machine.buses.resize(1);
  machine.devices.resize(1);
  machine.devices[0].channels.resize(2);
  machine.controller.emplace();
  return machine;
}

EventConfig event(MachineEventKind kind, TargetKind target, double at_s, double duration_s) {
  EventConfig made;
  made.kind = kind;
  made.target = target;
  made.at_s = at_s;
  made.duration_s = duration_s;
  made.channel = target == TargetKind::channel ? 1 : 0;
  return made;
}

SimulatedController two_axes() {
  SimulatedController controller;
  controller.axes.resize(2);
  controller.axes[1].offset_um_max = 10.0;
  controller.heartbeat = ModbusValue{};
  controller.heartbeat_timeout_s = 1.0;
  return controller;
}

}  // namespace

TEST_CASE("an event is active from its time for its duration, and only on its target") {
  MachineConfig machine = one_device();
  machine.events = {event(MachineEventKind::open_circuit, TargetKind::channel, 100.0, 50.0)};
  CHECK_FALSE(effects_at(machine, 99.9).channels[0][1].fault.has_value());
  CHECK(effects_at(machine, 100.0).channels[0][1].fault.has_value());
  CHECK_FALSE(effects_at(machine, 100.0).channels[0][0].fault.has_value());
  CHECK(effects_at(machine, 149.9).channels[0][1].fault.has_value());
  CHECK_FALSE(effects_at(machine, 150.0).channels[0][1].fault.has_value());
}

TEST_CASE("each kind of event has its effect") {
  MachineConfig machine = one_device();
  EventConfig made = event(
      GENERATE(MachineEventKind::freeze, MachineEventKind::drop, MachineEventKind::delay,
               MachineEventKind::garbage, MachineEventKind::exception, MachineEventKind::reboot),
      TargetKind::device, 10.0, 10.0);
  made.delay_ms = 300.0;
  made.code = 6;
  machine.events = {made};
  const UnitEffect effect = effects_at(machine, 15.0).devices[0];
  CHECK(effect.frozen == (made.kind == MachineEventKind::freeze));
  CHECK(effect.silent == (made.kind == MachineEventKind::drop));
  CHECK(effect.garbage == (made.kind == MachineEventKind::garbage));
  CHECK(effect.down == (made.kind == MachineEventKind::reboot));
  CHECK(effect.delay_ms == (made.kind == MachineEventKind::delay ? 300.0 : 0.0));
  CHECK(effect.exception.has_value() == (made.kind == MachineEventKind::exception));
}

TEST_CASE("spikes and drifts add up and end") {
  MachineConfig machine = one_device();
  EventConfig spike = event(MachineEventKind::spike, TargetKind::channel, 1000.0, 10.0);
  spike.change_K = 8.0;
  EventConfig drift = event(MachineEventKind::drift, TargetKind::channel, 0.0, 3600.0);
  drift.rate_K_per_h = 3.6;
  machine.events = {spike, drift};
  CHECK(effects_at(machine, 500.0).channels[0][1].added_K == Approx(0.5));
  CHECK(effects_at(machine, 1005.0).channels[0][1].added_K == Approx(8.0 + 1.005));
  CHECK(effects_at(machine, 3600.0).channels[0][1].added_K == 0.0);
}

TEST_CASE("a controller applies offsets only after a heartbeat and while it changes") {
  SimulatedCnc cnc(two_axes());
  cnc.take(0.0, {{5.0, 5.0}, 3, 1.0});
  cnc.step(0.1, {});
  CHECK(cnc.applied_um(0) == 0.0);  // a single heartbeat value is not a change
  cnc.take(0.2, {{5.0, 5.0}, 3, 2.0});
  cnc.step(0.3, {});
  CHECK(cnc.applied_um(0) == 5.0);
  cnc.take(1.5, {{7.0, 7.0}, 3, 2.0});  // the heartbeat stops
  cnc.step(1.6, {});
  CHECK(cnc.applied_um(0) == 5.0);
  CHECK_FALSE(cnc.alive());
  cnc.take(1.7, {{7.0, 7.0}, 3, 3.0});
  cnc.step(1.8, {});
  CHECK(cnc.applied_um(0) == 7.0);
}

TEST_CASE("a controller ignores offsets that are not valid, out of bound or not a number") {
  SimulatedController config = two_axes();
  config.heartbeat.reset();
  SimulatedCnc cnc(config);
  cnc.take(0.0, {{5.0, 5.0}, 3, 0.0});
  cnc.step(0.1, {});
  cnc.take(0.2, {{6.0, 6.0}, 2, 0.0});
  cnc.step(0.3, {});
  CHECK(cnc.applied_um(0) == 5.0);
  CHECK(cnc.applied_um(1) == 6.0);
  cnc.take(0.4, {{NAN, 10.5}, 3, 0.0});
  cnc.step(0.5, {});
  CHECK(cnc.applied_um(0) == 5.0);
  CHECK(cnc.applied_um(1) == 6.0);
}

TEST_CASE("a controller approaches the offset with its time constant and rate") {
  SimulatedController config = two_axes();
  config.heartbeat.reset();
  config.tau_s = 1.0;
  SimulatedCnc slow(config);
  slow.step(0.0, {});
  slow.take(0.0, {{10.0, 0.0}, 3, 0.0});
  for (int i = 1; i <= 100; ++i) slow.step(0.01 * i, {});
  CHECK(slow.applied_um(0) == Approx(10.0 * (1.0 - std::exp(-1.0))));
  config.tau_s = 0.0;
  config.axes[0].rate_um_per_s_max = 2.0;
  SimulatedCnc limited(config);
  limited.step(0.0, {});
  limited.take(0.0, {{10.0, 0.0}, 3, 0.0});
  limited.step(1.0, {});
  CHECK(limited.applied_um(0) == Approx(2.0));
}

TEST_CASE("a controller takes all nodes of a travel or none, and interpolates by its position") {
  SimulatedController config = two_axes();
  config.heartbeat.reset();
  config.axes[0].offset_um_max = 60.0;
  config.axes[0].travel.emplace();
  config.axes[0].travel->registers.nodes_mm = {0.0, 100.0, 300.0};
  config.axes[0].travel->interpolation_um_per_s_max = 10.0;
  SimulatedCnc cnc(config);
  CHECK(cnc.first(1) == 3);
  cnc.take(0.0, {{0.0, 5.0, 1.0, 7.0}, 3, 0.0});
  cnc.step(0.1, {});
  cnc.set_position(0, 1.0, 50.0);
  CHECK(cnc.applied_um(0) == Approx(2.5));
  cnc.set_position(0, 1.1, 200.0);
  CHECK(cnc.applied_um(0) == Approx(3.0));
  cnc.set_position(0, 1.15, 150.0);
  CHECK(cnc.applied_um(0) == Approx(3.5));  // limited by its own rate
  CHECK(cnc.applied_um(1) == 7.0);
  cnc.take(1.2, {{1.0, 100.0, 1.0, 8.0}, 3, 0.0});
  cnc.step(1.3, {});
  CHECK(cnc.nodes(0)[0] == 0.0);  // one is out of bound
  CHECK(cnc.nodes(0)[1] == 5.0);
  CHECK(cnc.applied_um(1) == 8.0);
  cnc.set_position(0, 9.0, 900.0);
  CHECK(cnc.applied_um(0) == Approx(1.0));  // a table is constant beyond its end
}

TEST_CASE("a set's number takes effect and is discarded with its values") {
  SimulatedController config = two_axes();
  config.heartbeat.reset();
  config.axes[0].travel.emplace();
  config.axes[0].travel->frames.emplace();
  config.axes[0].travel->frames->nodes_mm = {0.0, 100.0};
  SimulatedCnc cnc(config);
  CHECK(cnc.set_number(0) == 0);
  cnc.take(0.0, {{1.0, 2.0, 7.0}, 3, 0.0, {9, 0}});
  CHECK(cnc.set_number(0) == 9);
  cnc.take(0.1, {{3.0, 4.0, 7.0}, 2, 0.0, {10, 0}});  // its valid bit is 0
  cnc.step(0.2, {});
  CHECK(cnc.set_number(0) == 9);
  CHECK(cnc.nodes(0)[1] == 2.0);
  cnc.take(0.3, {{3.0, NAN, 7.0}, 3, 0.0, {11, 0}});
  CHECK(cnc.set_number(0) == 9);
  cnc.forget();
  CHECK(cnc.set_number(0) == 0);
}

TEST_CASE("a controller rejects, misapplies and loses offsets as scripted") {
  SimulatedController config = two_axes();
  config.heartbeat.reset();
  SimulatedCnc cnc(config);
  cnc.take(0.0, {{5.0, 5.0}, 3, 0.0});
  cnc.step(0.1, {});
  cnc.step(0.2, {true, 0.0, 0});
  cnc.take(0.3, {{6.0, 6.0}, 3, 0.0});
  cnc.step(0.4, {true, 0.0, 0});
  CHECK(cnc.applied_um(0) == 5.0);
  CHECK_FALSE(cnc.step(0.5, {false, 3.0, 0}));
  CHECK(cnc.applied_um(0) == 8.0);
  CHECK(cnc.step(0.6, {false, 0.0, 1}));  // homed
  CHECK(cnc.applied_um(0) == 0.0);
  CHECK_FALSE(cnc.step(0.7, {false, 0.0, 1}));
  cnc.take(0.8, {{6.0, 6.0}, 3, 0.0});
  cnc.step(0.9, {false, 0.0, 1});
  CHECK(cnc.applied_um(0) == 6.0);
}

TEST_CASE("a piezo with a dead band has two branches, and only the rising one from 0 V") {
  const SimulatedPiezoConfig config{10.0, {0.0, 100.0}, {-20.0, 30.0}};
  SimulatedPiezo piezo(config);
  CHECK(piezo.step(8.0) == -20.0);  // within the dead band
  CHECK(piezo.step(70.0) == Approx(10.0));
  CHECK(piezo.step(62.0) == Approx(10.0));  // reversed: no motion for 10 V
  CHECK(piezo.step(50.0) == Approx(5.0));
  CHECK(piezo.step(55.0) == Approx(5.0));
  CHECK(piezo.step(70.0) == Approx(10.0));
  CHECK(piezo.step(30.0) == Approx(-5.0));  // from above ...
  piezo.step(0.0);
  CHECK(piezo.step(30.0) == Approx(-10.0));  // ... and from 0 V
  CHECK(piezo.step(not_a_number) == Approx(-10.0));
}

TEST_CASE("a controller with a piezo shows volts, and its tool moves by the curve") {
  SimulatedController controller = two_axes();
  controller.axes[0].piezo = SimulatedPiezoConfig{10.0, {0.0, 100.0}, {-20.0, 30.0}};
  SimulatedCnc cnc(controller);
  cnc.take(0.0, {{60.0, 5.0}, 3, 1.0});
  cnc.take(0.2, {{60.0, 5.0}, 3, 2.0});
  cnc.step(0.3, {});
  CHECK(cnc.shown(0) == 60.0);
  CHECK(cnc.applied_um(0) == Approx(5.0));
  CHECK(cnc.shown(1) == cnc.applied_um(1));
  cnc.forget();
  CHECK(cnc.shown(0) == 0.0);
  CHECK(cnc.applied_um(0) == -20.0);
}
