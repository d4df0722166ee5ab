#include "simulator/plant/scripted_events.hpp"

namespace thermocomp {
namespace {

void befall(UnitEffect& unit, const EventConfig& event) {
  switch (event.kind) {
    case MachineEventKind::drop:
      unit.silent = true;
      break;
    case MachineEventKind::reboot:
      unit.down = true;
      break;
    case MachineEventKind::garbage:
      unit.garbage = true;
      break;
    case MachineEventKind::freeze:
      unit.frozen = true;
      break;
    case MachineEventKind::delay:
      unit.delay_ms = event.delay_ms;
      break;
    case MachineEventKind::exception:
      unit.exception = event.code;
      break;
    default:
      break;
  }
}

void befall(ChannelEffect& channel, const EventConfig& event, double since_s) {
  if (const auto fault = channel_fault(event.kind)) {
    channel.fault = fault;
    channel.code = event.channel_code;
    return;
  }
  switch (event.kind) {
    case MachineEventKind::freeze:
      channel.frozen = true;
      break;
    case MachineEventKind::spike:
      channel.added_K += event.change_K;
      break;
    case MachineEventKind::drift:
      channel.added_K += event.rate_K_per_h * since_s / 3600.0;
      break;
    default:
      break;
  }
}

void befall_controller(Effects& effects, const EventConfig& event) {
  switch (event.kind) {
    case MachineEventKind::reject:
      effects.controller.rejects = true;
      break;
    case MachineEventKind::misapply:
      effects.controller.misapplied_um = event.change_um;
      break;
    default:
      befall(effects.controller_unit, event);
      break;
  }
}

}  // namespace

std::optional<ChannelFault> channel_fault(MachineEventKind kind) {
  switch (kind) {
    case MachineEventKind::open_circuit:
      return ChannelFault::open_circuit;
    case MachineEventKind::short_circuit:
      return ChannelFault::short_circuit;
    case MachineEventKind::over_range:
      return ChannelFault::over_range;
    case MachineEventKind::under_range:
      return ChannelFault::under_range;
    case MachineEventKind::channel_error:
      return ChannelFault::error;
    default:
      return std::nullopt;
  }
}

Effects effects_at(const MachineConfig& machine, double plant_time_s) {
  Effects effects;
  effects.buses.resize(machine.buses.size());
  effects.devices.resize(machine.devices.size());
  for (const SimulatedDevice& device : machine.devices) {
    effects.channels.emplace_back(device.channels.size());
  }
  for (const EventConfig& event : machine.events) {
    const double since_s = plant_time_s - event.at_s;
    if (!(since_s >= 0.0)) continue;
    if (event.kind == MachineEventKind::rehome) ++effects.controller.rehomings;
    if (!(since_s < event.duration_s)) continue;
    switch (event.target) {
      case TargetKind::channel:
        befall(effects.channels.at(event.device).at(event.channel), event, since_s);
        break;
      case TargetKind::device:
        befall(effects.devices.at(event.device), event);
        break;
      case TargetKind::bus:
        befall(effects.buses.at(event.bus), event);
        break;
      case TargetKind::controller:
        befall_controller(effects, event);
        break;
    }
  }
  return effects;
}

}  // namespace thermocomp
