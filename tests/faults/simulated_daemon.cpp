#include "simulated_daemon.hpp"

#include <algorithm>

namespace thermocomp::faults {
namespace {

ModbusConnection connect_line(const ModbusLine& line, std::size_t index, LineEnd& end,
                              World& world) {
  const bool serial = std::holds_alternative<ModbusRtu>(line.link);
  return {line, std::make_unique<SimulatedLine>(index, serial, end, world.schedule, world.chance,
                                                world.clocks[index])};
}

}  // namespace

SteppedSource::SteppedSource(const ModbusBusConfig& config, std::size_t line, World& world)
    : world_(world),
      clock_(world.clocks[line]),
      connection_(connect_line(config.line, line, world.units[line], world)),
      poller_(config, connection_),
      seen_(sensors_count) {
  for (const ModbusDeviceConfig& device : config.devices)
    for (const ModbusChannel& channel : device.channels) sensors_.push_back(channel.sensor);
}

void SteppedSource::newest(std::span<Reading> all) noexcept {
  while (clock_ <= world_.now && poller_.next_action_at() <= world_.now) {
    poller_.newest(seen_);
    poller_.act();
  }
  if (clock_ <= world_.now) poller_.newest(seen_);
  for (const std::size_t sensor : sensors_) all[sensor] = seen_[sensor];
}

SteppedLink::SteppedLink(const ModbusControllerConfig& config, World& world)
    : world_(world),
      clock_(world.clocks[controller_line]),
      connection_(connect_line(config.line, controller_line, world.controller_unit, world)),
      dialogue_(config, connection_) {}

void SteppedLink::newest(ControllerState& state) noexcept {
  while (clock_ <= world_.now && dialogue_.next_action_at() <= world_.now) {
    dialogue_.newest(seen_);
    clock_ = std::max(clock_, dialogue_.next_action_at());
    dialogue_.act();
  }
  if (clock_ <= world_.now) dialogue_.newest(seen_);
  state = seen_;
}

SimulatedDaemon::SimulatedDaemon(const MachineShape& shape, World& world, const Grid& grid,
                                 std::unique_ptr<CycleParts> parts, LastSent* last_sent)
    : readings_(sensors_count),
      sources_{std::make_unique<SteppedSource>(shape.buses[0], 0, world),
               std::make_unique<SteppedSource>(shape.buses[1], 1, world)},
      tap_(readings_),
      link_(shape.controller, world),
      cycle_(grid, {sources_[0].get(), sources_[1].get(), &tap_}, link_, sensors_count,
             std::move(parts), last_sent) {}

}  // namespace thermocomp::faults
