#include "simulator/session/simulated_machine.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "drivers/can/can_socket.hpp"
#include "drivers/controllers/kinds/can/travel_frames.hpp"
#include "drivers/controllers/travel_values.hpp"
#include "estimator/checks.hpp"
#include "simulator/devices/can_node.hpp"
#include "simulator/devices/modbus_servers.hpp"
#include "simulator/devices/modbus_unit.hpp"
#include "simulator/devices/simulated_cnc.hpp"
#include "simulator/plant/scripted_events.hpp"
#include "simulator/plant/seeded_noise.hpp"

namespace thermocomp {
namespace {

constexpr std::uint64_t garbage_stream = 0x40000;
constexpr std::uint64_t probe_stream = 0x50000;
constexpr std::uint8_t gateway_target_failed = 0x0B;

std::size_t index_in(const std::vector<std::string>& columns, const std::string& column,
                     const std::string& user, const std::string& source) {
  const auto found = std::find(columns.begin(), columns.end(), column);
  if (found == columns.end()) {
    throw std::runtime_error(source + ": has no column " + column + ", which " + user + " shows");
  }
  return static_cast<std::size_t>(found - columns.begin());
}

UnitEffect both(UnitEffect a, const UnitEffect& b) {
  a.silent = a.silent || b.silent;
  a.down = a.down || b.down;
  a.garbage = a.garbage || b.garbage;
  a.frozen = a.frozen || b.frozen;
  a.delay_ms += b.delay_ms;
  if (!a.exception) a.exception = b.exception;
  return a;
}

struct Bus {
  SimulatedBus config;
  std::unique_ptr<ModbusTcpServer> tcp;
  std::unique_ptr<ModbusRtuLine> rtu;
  std::unique_ptr<CanNode> can;
  std::map<int, std::size_t> devices;  ///< unit -> device
  bool was_down{false};
};

struct Device {
  SimulatedDevice config;
  ModbusUnit unit;
  CanFrames frames;
  std::vector<std::size_t> columns;  ///< by channel
  nanoseconds next_conversion{};
  std::uint16_t conversions{0};
  bool was_down{false};
};

struct Controller {
  SimulatedController config;
  ModbusUnit unit;
  CanFrames frames;
  CncOrder order;
  SimulatedCnc cnc;
  std::vector<std::optional<std::size_t>> columns;    ///< by signal; none: fixed value
  std::vector<std::optional<std::size_t>> positions;  ///< by axis with a travel: its column
  std::vector<std::optional<CanSetReader>> sets;      ///< by axis: on CAN, if it has a travel
  std::vector<double> start;  ///< by signal: a probe's output at its first reading
  nanoseconds next_frame{};

  explicit Controller(const SimulatedController& from) : config(from), cnc(from) {
    std::size_t offsets = 0;
    for (const SimulatedAxis& axis : from.axes) offsets += axis.offsets();
    order.offset_um.assign(offsets, not_a_number);
    order.set_numbers.assign(from.axes.size(), 0);
  }
};

std::vector<CanSignal> signals_of(const CanSet& set) {
  std::vector<CanSignal> signals = set.values;
  signals.insert(signals.end(), set.numbers.begin(), set.numbers.end());
  return signals;
}

}  // namespace

struct SimulatedMachine::Parts {
  EventLoop& loop;
  MachineConfig config;
  std::vector<Bus> buses;  ///< those of the file, then the controller's
  std::vector<Device> devices;
  std::optional<Controller> controller;
  std::vector<BusPlace> places;
  Effects effects;
  std::uint64_t garbage_sent{0};

  Parts(EventLoop& on, const MachineConfig& machine) : loop(on), config(machine) {
    effects = effects_at(config, -1.0);
  }

  // -------------------------------------------------------------- building

  void add_device(const SimulatedDevice& from, const std::vector<std::string>& columns,
                  const std::string& source) {
    Device device;
    device.config = from;
    const bool can = config.buses[from.bus].kind == SimulatedBusKind::can;
    for (const SimulatedChannel& channel : from.channels) {
      device.columns.push_back(index_in(columns, channel.column, channel.name, source));
      if (can) {
        device.frames.define(channel.can);
        if (channel.counter) device.frames.define_counter(channel.can, *channel.counter);
        continue;
      }
      device.unit.define(channel.place, false);
      if (channel.status)
        device.unit.define(channel.status->table, channel.status->address, 1, false);
    }
    if (from.renewal) device.unit.define(from.renewal->table, from.renewal->address, 1, false);
    devices.push_back(std::move(device));
  }

  void add_controller(const std::vector<std::string>& columns, const std::string& source) {
    Controller& made = controller.emplace(*config.controller);
    const bool can = made.config.bus.kind == SimulatedBusKind::can;
    for (const SimulatedControllerSignal& signal : made.config.signals) {
      const std::string& column = signal.probe_of.value_or(signal.name);
      const bool known = std::find(columns.begin(), columns.end(), column) != columns.end();
      made.columns.push_back(
          known || !signal.value
              ? std::optional(index_in(columns, column, "the controller", source))
              : std::nullopt);
      made.start.push_back(not_a_number);
      can ? made.frames.define(signal.can) : made.unit.define(signal.place, false);
    }
    for (const SimulatedAxis& axis : made.config.axes) {
      auto& position = made.positions.emplace_back();
      auto& set = made.sets.emplace_back();
      if (axis.travel) {
        position = index_in(columns, axis.travel->position, "the controller", source);
        if (const auto& travel = axis.travel->frames) {
          set.emplace(travel->sent);
          for (const CanSignal& signal : signals_of(travel->applied)) made.frames.define(signal);
        } else {
          define_set(made.unit, axis.travel->registers);
        }
        continue;
      }
      if (!can) made.unit.define(axis.offset, true);
      if (axis.applied) made.unit.define(*axis.applied, false);
      if (axis.can_applied) made.frames.define(*axis.can_applied);
    }
    if (made.config.valid_bits) made.unit.define(*made.config.valid_bits, true);
    if (made.config.heartbeat) made.unit.define(*made.config.heartbeat, true);
  }

  static void define_set(ModbusUnit& unit, const ModbusTravel& travel) {
    unit.define(travel.begin, true);
    for (const ModbusValue& value : travel.values) unit.define(value, true);
    unit.define(travel.end, true);
    for (const ModbusValue& value : travel.applied) unit.define(value, false);
  }

  [[nodiscard]] std::vector<CanId> wanted_by_controller() const {
    std::vector<CanId> wanted;
    const auto subscribe = [&wanted](const CanSignal& signal) {
      wanted.push_back({signal.id, signal.extended_id});
    };
    for (const SimulatedAxis& axis : controller->config.axes) {
      if (!axis.travel) subscribe(axis.can_offset);
      if (axis.travel && axis.travel->frames)
        for (const CanSignal& number : axis.travel->frames->sent.numbers) subscribe(number);
    }
    for (const auto& signal : {controller->config.can_valid_bits, controller->config.can_heartbeat})
      if (signal) subscribe(*signal);
    return wanted;
  }

  void open_bus(std::size_t index) {
    Bus& bus = buses[index];
    BusPlace place{bus.config.name, bus.config.kind, 0, "", ""};
    const ModbusAnswerer answerer = [this, index](std::uint8_t unit,
                                                  std::span<const std::uint8_t> pdu) {
      return answer(index, unit, pdu);
    };
    switch (bus.config.kind) {
      case SimulatedBusKind::modbus_tcp:
        bus.tcp =
            std::make_unique<ModbusTcpServer>(loop, bus.config.host, bus.config.port, answerer);
        place.port = bus.tcp->port();
        break;
      case SimulatedBusKind::modbus_rtu:
        bus.rtu = std::make_unique<ModbusRtuLine>(
            loop, bus.config.device, RtuLineTiming{bus.config.baud, bus.config.line_delay},
            answerer);
        place.path = bus.config.device;
        break;
      case SimulatedBusKind::can:
        bus.can = std::make_unique<CanNode>(bus.config.interface, is_controllers(index)
                                                                      ? wanted_by_controller()
                                                                      : std::vector<CanId>{});
        place.path = bus.config.interface;
        place.unavailable = bus.can->error();
        break;
    }
    places.push_back(place);
  }

  [[nodiscard]] bool is_controllers(std::size_t bus) const { return bus == config.buses.size(); }

  // -------------------------------------------------------------- answering

  /// The unit's registers; nullptr: no such unit on the bus.
  ModbusUnit* find_unit(std::size_t bus, int unit, UnitEffect& effect) {
    if (is_controllers(bus)) {
      effect = effects.controller_unit;
      return unit == controller->config.unit ? &controller->unit : nullptr;
    }
    effect = effects.buses[bus];
    const auto found = buses[bus].devices.find(unit);
    if (found == buses[bus].devices.end()) return nullptr;
    effect = both(effect, effects.devices[found->second]);
    return &devices[found->second].unit;
  }

  std::optional<WireAnswer> answer(std::size_t bus, std::uint8_t number,
                                   std::span<const std::uint8_t> pdu) {
    UnitEffect effect;
    ModbusUnit* unit = find_unit(bus, number, effect);
    WireAnswer answer;
    answer.delay_ms = buses[bus].config.turnaround_ms + effect.delay_ms;
    if (effect.silent || effect.down) return std::nullopt;
    if (unit == nullptr) {
      if (buses[bus].rtu) return std::nullopt;
      answer.bytes = modbus_exception(pdu[0], gateway_target_failed);
      return answer;
    }
    if (effect.garbage) {
      answer.raw = true;
      answer.bytes = garbage();
      return answer;
    }
    if (effect.exception) {
      answer.bytes = modbus_exception(pdu[0], static_cast<std::uint8_t>(*effect.exception));
      return answer;
    }
    ModbusUnit::Answer good = unit->answer(pdu);
    if (good.wrote && is_controllers(bus)) take_written();
    answer.bytes = std::move(good.pdu);
    return answer;
  }

  std::vector<std::uint8_t> garbage() {
    const std::uint64_t number = garbage_sent++;
    std::vector<std::uint8_t> bytes(3 +
                                    seeded_bits(config.seed, garbage_stream, 1000 * number) % 30);
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<std::uint8_t>(
          seeded_bits(config.seed, garbage_stream, 1000 * number + 1 + i));
    }
    return bytes;
  }

  // -------------------------------------------------------------- controller

  /// Applied at once, so that a client reads back the result of its write.
  void take_written() {
    const SimulatedController& from = controller->config;
    for (std::size_t i = 0; i < from.axes.size(); ++i) {
      if (from.axes[i].travel)
        take_set(i, from.axes[i].travel->registers);
      else
        controller->order.offset_um[controller->cnc.first(i)] =
            controller->unit.value(from.axes[i].offset);
    }
    if (from.valid_bits) {
      controller->order.valid_bits = static_cast<std::uint64_t>(
          static_cast<std::int64_t>(controller->unit.value(*from.valid_bits)));
    }
    if (from.heartbeat) controller->order.heartbeat = controller->unit.value(*from.heartbeat);
    const double now_s = seconds_of(EventLoop::now());
    controller->cnc.take(now_s, controller->order);
    step_controller(now_s);
  }

  /// Takes a set only complete: `end` and `begin` hold the same set number.
  void take_set(std::size_t axis, const ModbusTravel& travel) {
    if (controller->unit.value(travel.end) != controller->unit.value(travel.begin)) return;
    std::vector<double> values;
    for (const ModbusValue& value : travel.values) values.push_back(controller->unit.value(value));
    offsets_shown(travel, values,
                  std::span(controller->order.offset_um)
                      .subspan(controller->cnc.first(axis), travel.nodes_mm.size()));
  }

  void take_frames(double now_s) {
    const auto frames = buses.back().can->receive();
    if (frames.empty() || effects.controller_unit.silent || effects.controller_unit.down) return;
    std::map<CanId, const CanFrame*> newest;
    for (const CanFrame& frame : frames) {
      newest[frame.id] = &frame;
      take_sets(frame);
    }
    const auto value_of = [&](const CanSignal& signal, double otherwise) {
      const auto found = newest.find({signal.id, signal.extended_id});
      if (found == newest.end()) return otherwise;
      const CanValue decoded = decode(found->second->payload(), signal);
      return decoded.fault == Fault::none ? decoded.value : otherwise;
    };
    const SimulatedController& from = controller->config;
    CncOrder& order = controller->order;
    for (std::size_t i = 0; i < from.axes.size(); ++i) {
      if (from.axes[i].travel) continue;
      double& offset_um = order.offset_um[controller->cnc.first(i)];
      offset_um = value_of(from.axes[i].can_offset, offset_um);
    }
    if (from.can_valid_bits) {
      order.valid_bits = static_cast<std::uint64_t>(
          value_of(*from.can_valid_bits, static_cast<double>(order.valid_bits & 0xFFFFFFFFu)));
    }
    if (from.can_heartbeat) order.heartbeat = value_of(*from.can_heartbeat, order.heartbeat);
    controller->cnc.take(now_s, order);
  }

  /// Takes a set only complete: every frame of the axis carries the same set number.
  void take_sets(const CanFrame& frame) {
    for (std::size_t axis = 0; axis < controller->sets.size(); ++axis) {
      auto& set = controller->sets[axis];
      if (!set) continue;
      const SimulatedTravel& travel = *controller->config.axes[axis].travel;
      set->forget_before(frame.received_at - from_seconds(travel.frame_age_s_max));
      if (set->take(frame) != CanSetReader::Taken::whole) continue;
      offsets_shown(travel.shape(), set->values(),
                    std::span(controller->order.offset_um)
                        .subspan(controller->cnc.first(axis), travel.shape().nodes_mm.size()));
      controller->order.set_numbers[axis] = set->number();
    }
  }

  void step_controller(double now_s) {
    const bool homed = controller->cnc.step(now_s, effects.controller);
    if (homed) forget_offsets();
    for (std::size_t i = 0; i < controller->config.axes.size(); ++i) {
      const SimulatedAxis& axis = controller->config.axes[i];
      const double applied = controller->cnc.shown(i);
      if (axis.travel) show_set(i, *axis.travel);
      if (axis.applied) controller->unit.set_value(*axis.applied, 0.0, applied);
      if (axis.can_applied) controller->frames.set_value(*axis.can_applied, applied);
    }
  }

  void show_set(std::size_t axis, const SimulatedTravel& travel) {
    const std::size_t count =
        travel.frames ? travel.frames->applied.values.size() : travel.registers.applied.size();
    if (count == 0) return;
    const std::vector<double> values =
        travel_values(travel.shape(), count, controller->cnc.nodes(axis));
    for (std::size_t i = 0; i < count; ++i) {
      if (travel.frames)
        controller->frames.set_value(travel.frames->applied.values[i], values[i]);
      else
        controller->unit.set_value(travel.registers.applied[i], 0.0, values[i]);
    }
    if (!travel.frames) return;
    const auto number = static_cast<std::int64_t>(controller->cnc.set_number(axis));
    for (const CanSignal& place : travel.frames->applied.numbers)
      controller->frames.set_code(place, number);
  }

  void forget_offsets() {
    controller->cnc.forget();
    std::fill(controller->order.offset_um.begin(), controller->order.offset_um.end(), not_a_number);
    for (auto& set : controller->sets)
      if (set) set->forget();
    if (controller->config.bus.kind == SimulatedBusKind::can) return;
    for (const SimulatedAxis& axis : controller->config.axes) {
      if (axis.travel) {
        for (const ModbusValue& value : axis.travel->registers.values)
          controller->unit.set_value(value, 0.0, 0.0);
        continue;
      }
      controller->unit.set_value(axis.offset, 0.0, 0.0);
    }
    if (controller->config.valid_bits) {
      controller->unit.set_value(*controller->config.valid_bits, 0.0, 0.0);
    }
  }

  /// Error at the tool as measured by a probe, with new noise each second.
  double probed_um(std::size_t signal, double plant_time_s, double displacement_um) {
    const SimulatedControllerSignal& probe = controller->config.signals[signal];
    double& start_um = controller->start[signal];
    if (std::isnan(start_um)) start_um = displacement_um;
    const auto second = static_cast<std::uint64_t>(std::max(0.0, plant_time_s));
    return displacement_um - start_um + applied_um(*probe.probe_of) +
           probe.noise_um * seeded_normal(config.seed, probe_stream + signal, second);
  }

  [[nodiscard]] double applied_um(const std::string& output) const {
    const auto& axes = controller->config.axes;
    for (std::size_t i = 0; i < axes.size(); ++i)
      if (axes[i].output == output) return axes[i].sign * controller->cnc.applied_um(i);
    return 0.0;
  }

  void update_controller(nanoseconds now, double plant_time_s, std::span<const double> row) {
    const SimulatedController& from = controller->config;
    const bool can = from.bus.kind == SimulatedBusKind::can;
    for (std::size_t i = 0; i < from.signals.size(); ++i) {
      double value =
          controller->columns[i] ? row[*controller->columns[i]] : from.signals[i].value.value_or(0);
      if (from.signals[i].probe_of) value = probed_um(i, plant_time_s, value);
      if (can) {
        controller->frames.set_value(from.signals[i].can, value);
      } else {
        controller->unit.set_value(from.signals[i].place, 0.0, value);
      }
    }
    if (can) take_frames(seconds_of(now));
    for (std::size_t i = 0; i < from.axes.size(); ++i)
      if (controller->positions[i])
        controller->cnc.set_position(i, seconds_of(now), row[*controller->positions[i]]);
    step_controller(seconds_of(now));
    const UnitEffect& effect = effects.controller_unit;
    if (can && now >= controller->next_frame && !effect.silent && !effect.down) {
      controller->next_frame = now + from_seconds(from.period_s);
      buses.back().can->send(controller->frames);
    }
  }

  // -------------------------------------------------------------- devices

  static std::optional<std::int64_t> code_for(const FaultCodes& codes,
                                              const ChannelEffect& effect) {
    return thermocomp::code_for(codes, effect.fault, effect.code);
  }

  /// A device that reports a fault in a status still shows a temperature; one without a code for an
  /// open circuit shows its highest value, or NaN.
  static double shown(const SimulatedChannel& channel, const ChannelEffect& effect, double value) {
    const bool shown_beside = (channel.status && code_for(channel.status->codes, effect)) ||
                              code_for(channel.can_status.codes, effect);
    return effect.fault == ChannelFault::open_circuit && !shown_beside ? not_a_number : value;
  }

  static void show_channel(Device& device, const SimulatedChannel& channel, bool can,
                           const ChannelEffect& effect, double value) {
    ChannelEffect seen = effect;
    if (std::isnan(value) && !seen.fault) seen.fault = ChannelFault::open_circuit;
    const auto code = code_for(channel.codes, seen);
    if (can) {
      code ? device.frames.set_code(channel.can, *code)
           : device.frames.set_value(channel.can, shown(channel, seen, value));
      const CanStatusCodes& status = channel.can_status;
      device.frames.set_status(channel.can, code_for(status.codes, seen).value_or(status.good));
      return;
    }
    if (code) {
      device.unit.set_code(channel.place, *code);
    } else {
      device.unit.set_value(channel.place, channel.offset_degC, shown(channel, seen, value));
    }
    if (!channel.status) return;
    const SimulatedStatus& status = *channel.status;
    const auto status_code = code_for(status.codes, seen);
    const auto bits = static_cast<unsigned>(status_code ? *status_code : status.good) & status.mask;
    const unsigned others =
        device.unit.word(status.table, status.address) & ~static_cast<unsigned>(status.mask);
    device.unit.set(status.table, status.address, static_cast<std::uint16_t>(bits | others));
  }

  void convert(std::size_t index, std::span<const double> row) {
    Device& device = devices[index];
    if (both(effects.devices[index], effects.buses[device.config.bus]).frozen) return;
    const bool can = buses[device.config.bus].can != nullptr;
    for (std::size_t i = 0; i < device.config.channels.size(); ++i) {
      const ChannelEffect& effect = effects.channels[index][i];
      if (effect.frozen) continue;
      const double value = row[device.columns[i]] + effect.added_K;
      show_channel(device, device.config.channels[i], can, effect, value);
    }
    ++device.conversions;
    device.frames.count();
    if (device.config.renewal) {
      device.unit.set(device.config.renewal->table, device.config.renewal->address,
                      device.conversions);
    }
  }

  void update_device(std::size_t index, nanoseconds now, std::span<const double> row,
                     bool new_row) {
    Device& device = devices[index];
    const bool due = now >= device.next_conversion;
    if (!due && !new_row) return;
    if (due) {
      // Keeps the phase unless late.
      const nanoseconds period = from_seconds(device.config.period_s);
      device.next_conversion = std::max(device.next_conversion + period, now + period / 2);
    }
    convert(index, row);
    Bus& bus = buses[device.config.bus];
    const UnitEffect effect = both(effects.devices[index], effects.buses[device.config.bus]);
    if (bus.can && !effect.silent && !effect.down) bus.can->send(device.frames);
  }

  // -------------------------------------------------------------- reboots

  void switch_bus(Bus& bus, bool down) {
    if (down && !bus.was_down) {
      if (bus.tcp) bus.tcp->switch_off();
      if (bus.rtu) bus.rtu->discard();
    }
    if (!down && bus.tcp) bus.tcp->switch_on();
    bus.was_down = down;
  }

  void apply_reboots() {
    for (std::size_t i = 0; i < config.buses.size(); ++i)
      switch_bus(buses[i], effects.buses[i].down);
    for (std::size_t i = 0; i < devices.size(); ++i) {
      const bool down = effects.devices[i].down;
      Bus& bus = buses[devices[i].config.bus];
      if (down && !devices[i].was_down && bus.tcp) bus.tcp->close_connections();
      devices[i].was_down = down;
    }
    if (!controller) return;
    if (effects.controller_unit.down && !buses.back().was_down) forget_offsets();
    switch_bus(buses.back(), effects.controller_unit.down);
  }
};

SimulatedMachine::SimulatedMachine(EventLoop& loop, const MachineConfig& config,
                                   const std::vector<std::string>& columns,
                                   const std::string& source)
    : parts_(std::make_unique<Parts>(loop, config)) {
  for (const SimulatedDevice& device : config.devices) {
    parts_->add_device(device, columns, source);
  }
  if (config.controller) parts_->add_controller(columns, source);
  for (const SimulatedBus& bus : config.buses) parts_->buses.push_back({bus, {}, {}, {}, {}});
  if (config.controller) parts_->buses.push_back({config.controller->bus, {}, {}, {}, {}});
  for (std::size_t i = 0; i < config.devices.size(); ++i) {
    parts_->buses[config.devices[i].bus].devices[config.devices[i].unit] = i;
  }
  for (std::size_t i = 0; i < parts_->buses.size(); ++i) parts_->open_bus(i);
}

SimulatedMachine::~SimulatedMachine() = default;

const std::vector<BusPlace>& SimulatedMachine::places() const noexcept {
  return parts_->places;
}

void SimulatedMachine::update(nanoseconds now, double plant_time_s, std::span<const double> row,
                              bool new_row) {
  parts_->effects = effects_at(parts_->config, plant_time_s);
  parts_->apply_reboots();
  for (Bus& bus : parts_->buses) {
    if (bus.can) bus.can->keep_open(now);
  }
  for (std::size_t i = 0; i < parts_->devices.size(); ++i) {
    parts_->update_device(i, now, row, new_row);
  }
  if (parts_->controller) parts_->update_controller(now, plant_time_s, row);
}

double SimulatedMachine::applied_um(const std::string& output) const {
  return parts_->controller ? parts_->applied_um(output) : 0.0;
}

bool SimulatedMachine::heartbeat_seen() const {
  return !parts_->controller || parts_->controller->cnc.beaten();
}

}  // namespace thermocomp
