#include <algorithm>
#include <functional>
#include <map>

#include "config/buses/presets.hpp"
#include "config/sections/travel_section.hpp"
#include "config/text/units.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "estimator/checks.hpp"
#include "simulator/files/can_places.hpp"
#include "simulator/files/machine_file_parts.hpp"
#include "simulator/plant/scripted_events.hpp"

namespace thermocomp {
namespace {

const Names<Encoding> encoding_names{
    {"int16", Encoding::int16},   {"uint16", Encoding::uint16},   {"int32", Encoding::int32},
    {"uint32", Encoding::uint32}, {"float32", Encoding::float32}, {"float64", Encoding::float64}};
const Names<WordOrder> order_names{{"ABCD", WordOrder::abcd},
                                   {"DCBA", WordOrder::dcba},
                                   {"BADC", WordOrder::badc},
                                   {"CDAB", WordOrder::cdab}};

/// Words of a unit's tables, or bits of a frame, in use; values must not overlap.
class Occupied {
 public:
  /// Takes the words. @return all were free
  bool take(int unit, ModbusTable table, std::size_t address, std::size_t count,
            std::uint16_t mask = 0xFFFF) {
    return words_.take(unit, table, address, count, mask);
  }
  bool take(const CanSignal& signal) { return frames_.take(signal); }
  bool take(const CanSignal& signal, const CanField& counter) {
    return frames_.take(signal, counter);
  }

 private:
  RegistersTaken words_;
  FramesTaken frames_;
};

SimulatedBus read_link(const TomlTable& table, SimulatedBusKind kind) {
  SimulatedBus bus;
  bus.kind = kind;
  switch (kind) {
    case SimulatedBusKind::modbus_tcp:
      bus.host = table.text("host", bus.host);
      bus.port = table.integer("port", 0, 65535, 0);
      break;
    case SimulatedBusKind::modbus_rtu:
      bus.device = table.text("device");
      bus.baud = table.integer("baud", 300, 4'000'000, bus.baud);
      bus.line_delay = table.flag("line_delay", false);
      break;
    case SimulatedBusKind::can:
      bus.interface = table.text("interface");
      return bus;
  }
  bus.turnaround_ms = table.number("turnaround_ms", Range::between(0.0, 10000.0), 0.0);
  return bus;
}

const Names<SimulatedBusKind> bus_kind_names{{"modbus_tcp", SimulatedBusKind::modbus_tcp},
                                             {"modbus_rtu", SimulatedBusKind::modbus_rtu},
                                             {"can", SimulatedBusKind::can}};

/// A value's register place; missing keys come from `defaults`.
ModbusValue read_place(const TomlTable& table, const ModbusValue& defaults) {
  ModbusValue value;
  value.table = table.choice("table", table_names, defaults.table);
  value.address = table.integer<std::uint16_t>("address", 0, 65535);
  value.encoding = table.choice("encoding", encoding_names, defaults.encoding);
  value.word_order = table.choice("word_order", order_names, defaults.word_order);
  value.scale = table.number("scale", Range::between(-1e6, 1e6), defaults.scale);
  if (value.scale == 0.0) table.problem("scale", "must not be 0");
  const std::size_t words = words_of(value.table, value.encoding);
  if (value.address + words > 65536) table.problem("address", "has its last register beyond 65535");
  return value;
}

/// Codes of any encoding; each channel checks them against its own.
FaultCodes read_codes(const TomlTable& table) {
  return read_fault_codes(table, -4294967296LL, 4294967295LL);
}

struct Draft {
  MachineConfig& machine;
  NameList buses;
  NameList devices;
  NameList channels;
  std::vector<std::pair<std::size_t, std::size_t>> channel_places;  ///< device and its channel
  std::vector<std::string> columns;                                 ///< of the plant
  std::map<std::size_t, Occupied> occupied;                         ///< by bus
};

/// Register keys that a device gives its channels as defaults.
struct DeviceDefaults {
  ModbusValue place;
  double offset_degC{0.0};
  FaultCodes codes;
  int base_address{0};  ///< added to the addresses of all registers
  TomlTable table;      ///< own keys over the preset's, if any
  const sections::Preset* preset{nullptr};
};

void check_column(const Draft& state, const TomlTable& table, std::string_view key,
                  const std::string& column) {
  if (!state.machine.plant) return;  // a replayed file defines the columns
  const auto& columns = state.columns;
  if (std::find(columns.begin(), columns.end(), column) != columns.end()) return;
  std::string rule = "must be a column of the plant";
  const std::string near = nearest_name(column, columns);
  if (!near.empty()) rule += "; did you mean \"" + near + "\"?";
  table.problem(key, rule);
}

void take(Draft& state, std::size_t bus, int unit, const ModbusValue& value, const TomlTable& table,
          std::uint16_t mask = 0xFFFF) {
  if (!state.occupied[bus].take(unit, value.table, value.address,
                                words_of(value.table, value.encoding), mask)) {
    table.problem(table.has("channel") ? "channel" : "address",
                  "shares a register with another value of this unit");
  }
}

void take(Draft& state, std::size_t bus, const CanSignal& signal, const TomlTable& table) {
  if (!state.occupied[bus].take(signal)) {
    table.problem("start_bit", "shares a bit with another value of this frame");
  }
}

/// The device's keys over those of its preset, if it has a readable one.
DeviceDefaults find_preset(sections::Presets& presets, const TomlTable& own, bool can) {
  DeviceDefaults defaults{{}, 0.0, {}, 0, own, presets.of_device(own)};
  if (defaults.preset == nullptr) return defaults;
  defaults.table = sections::Presets::over_preset(own, *defaults.preset, can ? "can" : "modbus");
  return defaults;
}

DeviceDefaults read_device(Draft& state, const TomlTable& own, sections::Presets& presets) {
  SimulatedDevice device;
  device.name = state.devices.read(own);
  device.bus = state.buses.index(own, "bus", "bus");
  device.period_s = own.number("period_s", Range::between(0.001, 3600.0), device.period_s);
  const bool can =
      !state.machine.buses.empty() && state.machine.buses[device.bus].kind == SimulatedBusKind::can;
  DeviceDefaults defaults = find_preset(presets, own, can);
  const TomlTable& table = defaults.table;
  defaults.place.table = ModbusTable::input;
  if (!can) {
    device.unit = table.integer("unit", 0, 255);
    const bool used = std::any_of(
        state.machine.devices.begin(), state.machine.devices.end(),
        [&](const auto& other) { return other.bus == device.bus && other.unit == device.unit; });
    if (used) table.problem("unit", "is used by another device of this bus");
    defaults.place.table = table.choice("table", table_names, defaults.place.table);
    defaults.place.encoding = table.choice("encoding", encoding_names, defaults.place.encoding);
    defaults.place.word_order = table.choice("word_order", order_names, WordOrder::abcd);
    defaults.place.scale = table.number("scale", Range::between(-1e6, 1e6), 1.0);
    if (defaults.place.scale == 0.0) table.problem("scale", "must not be 0");
    defaults.offset_degC = table.number("offset_degC", Range::between(-1e6, 1e6), 0.0);
    defaults.codes = read_codes(table);
    defaults.base_address = table.integer("base_address", 0, 65535, 0);
    if (table.has("renewal")) {
      const TomlTable renewal = table.table("renewal");
      ModbusValue value;
      value.table = renewal.choice("table", table_names, ModbusTable::input);
      value.address = renewal.integer<std::uint16_t>("address", 0, 65535);
      device.renewal = ModbusRenewal{value.table, value.address};
      take(state, device.bus, device.unit, value, renewal);
    }
  }
  state.machine.devices.push_back(device);
  return defaults;
}

/// Adds the device's base address; reports a result beyond the last register.
std::uint16_t moved(const TomlTable& table, std::uint16_t address, int base_address) {
  if (address + base_address <= 65535) return static_cast<std::uint16_t>(address + base_address);
  table.problem("address", "exceeds register 65535 with the device's base_address");
  return address;
}

/// Converts a code given as the bits of a signed number, such as 0x8000 for -32768.
std::int64_t signed_code(std::int64_t code, Encoding encoding) {
  if (encoding == Encoding::int16 && code > INT16_MAX && code <= UINT16_MAX) return code - 0x10000;
  if (encoding == Encoding::int32 && code > INT32_MAX && code <= UINT32_MAX)
    return code - 0x100000000;
  return code;
}

void check_codes(const TomlTable& table, SimulatedChannel& channel) {
  for (auto& [fault, codes] : channel.codes) {
    for (std::int64_t& code : codes) {
      code = signed_code(code, channel.place.encoding);
      if (is_representable(code, channel.place.encoding)) continue;
      table.problem("open_circuit_codes", std::to_string(code),
                    "cannot be expressed in the channel's encoding");
    }
  }
}

void read_registers(Draft& state, const TomlTable& table, const DeviceDefaults& defaults,
                    const SimulatedDevice& device, SimulatedChannel& channel) {
  channel.place = read_place(table, defaults.place);
  channel.place.address = moved(table, channel.place.address, defaults.base_address);
  channel.offset_degC =
      table.number("offset_degC", Range::between(-1e6, 1e6), defaults.offset_degC);
  channel.codes = defaults.codes;
  for (const auto& [fault, codes] : read_codes(table)) channel.codes[fault] = codes;
  check_codes(table, channel);
  take(state, device.bus, device.unit, channel.place, table);
  if (!table.has("status")) return;
  const TomlTable status = table.table("status");
  channel.status = read_simulated_status(status);
  ModbusValue word;
  word.table = channel.status->table;
  if (!is_bit_table(word.table)) {
    channel.status->address = moved(status, channel.status->address, defaults.base_address);
  }
  word.address = channel.status->address;
  take(state, device.bus, device.unit, word, status, channel.status->mask);
}

void read_channel(Draft& state, const TomlTable& own, const std::vector<DeviceDefaults>& defaults) {
  SimulatedChannel channel;
  channel.name = state.channels.read(own);
  const std::size_t index = state.devices.index(own, "device", "device");
  channel.column = own.text("column", channel.name + "_degC");
  check_column(state, own, own.has("column") ? "column" : "name", channel.column);
  if (state.machine.devices.empty()) return own.ignore_rest();
  const sections::Preset* preset = defaults[index].preset;
  const TomlTable table =
      preset == nullptr ? own
                        : sections::Presets::over_channel(own, defaults[index].table, *preset);
  SimulatedDevice& device = state.machine.devices[index];
  state.channel_places.emplace_back(index, device.channels.size());
  if (state.machine.buses[device.bus].kind == SimulatedBusKind::can) {
    const TomlTable full = preset == nullptr ? table : table.over(defaults[index].table);
    channel.can = read_can(full, CanUse::temperature);
    channel.codes = read_codes(full);
    if (full.has("status")) channel.can_status = read_can_status_codes(full.table("status"));
    take(state, device.bus, channel.can, table);
    if (channel.can.status &&
        !state.occupied[device.bus].take(channel.can, channel.can.status->field)) {
      table.problem("status", "shares a bit with another value of this frame");
    }
    channel.counter = read_counter(table, channel.can);
    if (channel.counter && !state.occupied[device.bus].take(channel.can, *channel.counter)) {
      table.problem("counter", "shares a bit with another value of this frame");
    }
  } else {
    read_registers(state, table, defaults[index], device, channel);
  }
  device.channels.push_back(channel);
}

/// Reads the place of a controller's value, in registers or frames.
template <class Registers, class Frame>
void read_value(Draft& state, const TomlTable& table, ModbusTable usual, std::size_t bus,
                Registers& registers, Frame& frame, CanUse use = CanUse::signal) {
  if (state.machine.controller->bus.kind == SimulatedBusKind::can) {
    frame = read_can(table, use);
    CanSignal signal = frame.value_or(CanSignal{});
    take(state, bus, signal, table);
    return;
  }
  ModbusValue defaults;
  defaults.table = usual;
  registers = read_place(table, defaults);
  take(state, bus, state.machine.controller->unit, *registers, table);
}

SimulatedPiezoConfig read_piezo(const TomlTable& table) {
  SimulatedPiezoConfig piezo;
  piezo.dead_band_V = table.number("dead_band_V", Range::between(0.0, 1000.0), 0.0);
  piezo.curve_V = table.numbers("curve_V", Range::between(0.0, 1000.0));
  piezo.curve_um = table.numbers("curve_um", Range::between(-1000.0, 1000.0));
  for (const auto& [key, values] :
       {std::pair{"curve_V", &piezo.curve_V}, std::pair{"curve_um", &piezo.curve_um}}) {
    if (values->size() < 2 || values->size() != piezo.curve_V.size())
      table.problem(key, "must be two or more numbers, as many of volts as of displacement");
    if (std::adjacent_find(values->begin(), values->end(), std::greater_equal<>()) != values->end())
      table.problem(key, "must increase");
  }
  if (!piezo.curve_V.empty() && piezo.curve_V.front() != 0.0)
    table.problem("curve_V", "must begin at 0 V");
  return piezo;
}

/// Only the bound: the simulated controller's slew limit is separate.
LimiterConfig bound_of(double offset_um_max) {
  LimiterConfig limiter;
  limiter.offset_um_max = offset_um_max;
  limiter.rate_um_per_s_max = 1e6;
  return limiter;
}

/// Reads a travel's frames, sent and shown; bits used twice in a set are already reported.
CanTravel read_travel_frames(Draft& state, const TomlTable& axis, double offset_um_max,
                             std::size_t bus) {
  sections::TakenBits sent;
  sections::CanTravelSection section(axis, bound_of(offset_um_max), sent);
  section.read_applied(sent);
  const CanTravel& travel = section.travel();
  const TomlTable table = sections::travel_table(axis);
  for (const CanSet* set : {&travel.sent, &travel.applied}) {
    for (const CanSignal& signal : set->values) take(state, bus, signal, table);
    for (const CanSignal& signal : set->numbers) take(state, bus, signal, table);
  }
  return travel;
}

/// Reads [axis.line] or [axis.table] with the keys of the daemon's file.
SimulatedTravel read_travel(Draft& state, const TomlTable& axis, double offset_um_max,
                            std::size_t bus) {
  const TomlTable table = sections::travel_table(axis);
  const SimulatedController& controller = *state.machine.controller;
  SimulatedTravel travel;
  travel.position = table.text("position");
  check_column(state, table, "position", travel.position);
  travel.interpolation_um_per_s_max =
      table.number("interpolation_um_per_s_max", Range::between(0.0, 1e6), 0.0);
  if (controller.bus.kind == SimulatedBusKind::can) {
    travel.frames = read_travel_frames(state, axis, offset_um_max, bus);
    travel.frame_age_s_max =
        table.number("frame_age_s_max", Range::above(0.0, 3600.0), travel.frame_age_s_max);
    return travel;
  }
  sections::WrittenRegisters written;
  travel.registers = sections::read_modbus_travel(axis, bound_of(offset_um_max), written);
  const auto take_all = [&](const std::vector<ModbusValue>& values) {
    for (const ModbusValue& value : values) take(state, bus, controller.unit, value, table);
  };
  take_all({travel.registers.begin, travel.registers.end});
  take_all(travel.registers.values);
  take_all(travel.registers.applied);
  return travel;
}

void read_axis(Draft& state, const TomlTable& table, NameList& axes, std::size_t bus) {
  SimulatedAxis axis;
  axis.name = axes.read(table);
  axis.output = table.text("output");
  check_column(state, table, "output", axis.output);
  const auto& others = state.machine.controller->axes;
  if (std::any_of(others.begin(), others.end(),
                  [&](const auto& other) { return other.output == axis.output; })) {
    table.problem("output", "is used by another axis");
  }
  axis.sign = table.number("sign", Range::between(-1.0, 1.0), 1.0);
  if (axis.sign != 1.0 && axis.sign != -1.0) table.problem("sign", "must be 1 or -1");
  axis.offset_um_max = table.number("offset_um_max", Range::between(0.0, 1e6), 0.0);
  if (table.has("piezo")) axis.piezo = read_piezo(table.table("piezo"));
  axis.rate_um_per_s_max = table.number("rate_um_per_s_max", Range::between(0.0, 1e6), 0.0);
  if (sections::travel_table(table)) {
    axis.travel = read_travel(state, table, axis.offset_um_max, bus);
    state.machine.controller->axes.push_back(axis);
    return;
  }
  std::optional<ModbusValue> registers;
  std::optional<CanSignal> frame;
  read_value(state, table.table("offset"), ModbusTable::holding, bus, registers, frame);
  axis.offset = registers.value_or(ModbusValue{});
  axis.can_offset = frame.value_or(CanSignal{});
  if (table.has("applied")) {
    read_value(state, table.table("applied"), ModbusTable::input, bus, axis.applied,
               axis.can_applied);
  }
  state.machine.controller->axes.push_back(axis);
}

void read_controller_signal(Draft& state, const TomlTable& table, NameList& names,
                            std::size_t bus) {
  SimulatedControllerSignal signal;
  signal.name = names.read(table);
  if (table.has("value")) signal.value = table.number("value", Range::between(-large, large));
  if (table.has("probe_of")) {
    signal.probe_of = table.text("probe_of");
    check_column(state, table, "probe_of", *signal.probe_of);
    if (!is_output(*signal.probe_of)) table.problem("probe_of", "must end in _um or _urad");
    signal.noise_um = table.number("noise_um", Range::between(0.0, 1e6), 0.0);
  } else if (!signal.value) {
    check_column(state, table, "name", signal.name);
  }
  std::optional<ModbusValue> registers;
  std::optional<CanSignal> frame;
  read_value(state, table, ModbusTable::input, bus, registers, frame);
  signal.place = registers.value_or(ModbusValue{});
  signal.can = frame.value_or(CanSignal{});
  state.machine.controller->signals.push_back(signal);
}

void read_controller(Draft& state, const TomlTable& root) {
  const TomlTable table = root.table("controller");
  state.machine.controller.emplace();
  SimulatedController& controller = *state.machine.controller;
  const auto kind = table.choice("kind", bus_kind_names);
  controller.bus = read_link(table, kind);
  controller.bus.name = state.buses.read(table);
  const std::size_t bus = state.buses.names().size() - 1;
  if (kind == SimulatedBusKind::can) {
    controller.period_s =
        table.number("period_s", Range::between(0.001, 3600.0), controller.period_s);
  } else {
    controller.unit = table.integer("unit", 0, 255, 1);
  }
  controller.tau_s = table.number("tau_s", Range::between(0.0, 1e6), 0.0);
  controller.heartbeat_timeout_s =
      table.number("heartbeat_timeout_s", Range::between(0.0, 1e6), controller.heartbeat_timeout_s);
  if (table.has("valid_bits")) {
    read_value(state, table.table("valid_bits"), ModbusTable::holding, bus, controller.valid_bits,
               controller.can_valid_bits, CanUse::bits);
  }
  if (table.has("heartbeat")) {
    read_value(state, table.table("heartbeat"), ModbusTable::holding, bus, controller.heartbeat,
               controller.can_heartbeat, CanUse::bits);
  }
  NameList names;
  for (const TomlTable& entry : table.tables("signal")) {
    read_controller_signal(state, entry, names, bus);
  }
  NameList axes;
  for (const TomlTable& entry : root.tables("axis")) read_axis(state, entry, axes, bus);
  std::size_t offsets = 0;
  for (const SimulatedAxis& axis : controller.axes) offsets += axis.offsets();
  if (offsets > axes_max) table.problem("axis", "must be at most 16, nodes of travels counted");
}

void read_target(const Draft& state, const TomlTable& table, EventConfig& event) {
  const std::string name = table.text("target");
  const auto place = [&](const std::vector<std::string>& names) {
    const auto found = std::find(names.begin(), names.end(), name);
    return found == names.end() ? std::optional<std::size_t>{}
                                : std::optional(static_cast<std::size_t>(found - names.begin()));
  };
  if (const auto channel = place(state.channels.names())) {
    event.target = TargetKind::channel;
    if (*channel < state.channel_places.size()) {
      std::tie(event.device, event.channel) = state.channel_places[*channel];
    }
  } else if (const auto device = place(state.devices.names())) {
    event.target = TargetKind::device;
    event.device = *device;
  } else if (state.machine.controller && name == state.machine.controller->bus.name) {
    event.target = TargetKind::controller;
  } else if (const auto bus = place(state.buses.names())) {
    event.target = TargetKind::bus;
    event.bus = *bus;
  } else {
    table.problem("target", "must name a channel, a device, a bus or the controller");
  }
}

bool fits(MachineEventKind kind, TargetKind target, bool can) {
  switch (kind) {
    case MachineEventKind::open_circuit:
    case MachineEventKind::short_circuit:
    case MachineEventKind::over_range:
    case MachineEventKind::under_range:
    case MachineEventKind::channel_error:
    case MachineEventKind::spike:
    case MachineEventKind::drift:
      return target == TargetKind::channel;
    case MachineEventKind::freeze:
      return target == TargetKind::channel || target == TargetKind::device;
    case MachineEventKind::drop:
    case MachineEventKind::reboot:
      return target != TargetKind::channel;
    case MachineEventKind::delay:
    case MachineEventKind::garbage:
    case MachineEventKind::exception:
      return target != TargetKind::channel && !can;
    case MachineEventKind::reject:
    case MachineEventKind::misapply:
    case MachineEventKind::rehome:
      return target == TargetKind::controller;
  }
  return false;
}

bool on_can(const Draft& state, const EventConfig& event) {
  const MachineConfig& machine = state.machine;
  if (event.target == TargetKind::controller) {
    return machine.controller->bus.kind == SimulatedBusKind::can;
  }
  const std::size_t bus = event.target == TargetKind::bus || machine.devices.empty()
                              ? event.bus
                              : machine.devices[event.device].bus;
  return bus < machine.buses.size() && machine.buses[bus].kind == SimulatedBusKind::can;
}

/// A channel can only show faults for which its device has a code, except an open circuit.
void read_channel_code(const Draft& state, const TomlTable& table, EventConfig& event) {
  const auto fault = channel_fault(event.kind);
  if (!fault || event.target != TargetKind::channel || state.machine.devices.empty()) return;
  const auto& channels = state.machine.devices[event.device].channels;
  if (event.channel >= channels.size()) return;  // already reported
  const SimulatedChannel& channel = channels[event.channel];
  const auto has = [&](const FaultCodes& codes) { return codes.contains(*fault); };
  if (!has(channel.codes) && !(channel.status && has(channel.status->codes)) &&
      !has(channel.can_status.codes) && *fault != ChannelFault::open_circuit) {
    table.problem("kind", "the channel's device has no code for it");
  }
  if (!table.has("code")) return;
  event.channel_code =
      table.integer<std::int64_t>("code", -4294967296LL, std::int64_t{4294967295LL});
  const auto lists = [&](const FaultCodes& codes) {
    const auto found = codes.find(*fault);
    return found != codes.end() && std::find(found->second.begin(), found->second.end(),
                                             *event.channel_code) != found->second.end();
  };
  if (!lists(channel.codes) && !(channel.status && lists(channel.status->codes)) &&
      !lists(channel.can_status.codes)) {
    table.problem("code", "must be a code of the channel's device for this fault");
  }
}

EventConfig read_event(const Draft& state, const TomlTable& table) {
  EventConfig event;
  event.kind =
      table.choice<MachineEventKind>("kind", {{"open_circuit", MachineEventKind::open_circuit},
                                              {"short_circuit", MachineEventKind::short_circuit},
                                              {"over_range", MachineEventKind::over_range},
                                              {"under_range", MachineEventKind::under_range},
                                              {"channel_error", MachineEventKind::channel_error},
                                              {"freeze", MachineEventKind::freeze},
                                              {"spike", MachineEventKind::spike},
                                              {"drift", MachineEventKind::drift},
                                              {"drop", MachineEventKind::drop},
                                              {"delay", MachineEventKind::delay},
                                              {"garbage", MachineEventKind::garbage},
                                              {"exception", MachineEventKind::exception},
                                              {"reboot", MachineEventKind::reboot},
                                              {"reject", MachineEventKind::reject},
                                              {"misapply", MachineEventKind::misapply},
                                              {"rehome", MachineEventKind::rehome}});
  event.at_s = table.number("at_s", Range::between(0.0, large));
  read_target(state, table, event);
  if (event.kind != MachineEventKind::rehome) {
    event.duration_s = table.number("duration_s", Range::above(0.0, large));
  }
  if (event.kind == MachineEventKind::spike) {
    event.change_K = table.number("change_K", Range::between(-1e4, 1e4));
  }
  if (event.kind == MachineEventKind::misapply) {
    event.change_um = table.number("change_um", Range::between(-1e4, 1e4));
  }
  if (event.kind == MachineEventKind::drift) {
    event.rate_K_per_h = table.number("rate_K_per_h", Range::between(-1e6, 1e6));
  }
  if (event.kind == MachineEventKind::delay) {
    event.delay_ms = table.number("delay_ms", Range::above(0.0, 1e6));
  }
  read_channel_code(state, table, event);
  if (event.kind == MachineEventKind::exception) event.code = table.integer("code", 1, 255, 6);
  if (!fits(event.kind, event.target, on_can(state, event))) {
    table.problem("kind", "does not apply to this target");
  }
  return event;
}

}  // namespace

void read_devices(const TomlTable& root, sections::Presets& presets, MachineConfig& machine) {
  Draft state{machine, {}, {}, {}, {}, {}, {}};
  if (machine.plant) state.columns = plant_columns(*machine.plant);
  for (const TomlTable& table : root.tables("bus")) {
    SimulatedBus bus = read_link(table, table.choice("kind", bus_kind_names));
    bus.name = state.buses.read(table);
    machine.buses.push_back(bus);
  }
  std::vector<DeviceDefaults> defaults;
  for (const TomlTable& table : root.tables("device")) {
    defaults.push_back(read_device(state, table, presets));
  }
  if (machine.buses.empty()) {
    machine.devices.clear();  // already reported: they name no bus
  }
  for (const TomlTable& table : root.tables("channel")) read_channel(state, table, defaults);
  if (root.has("controller")) {
    read_controller(state, root);
  } else if (root.has("axis")) {
    root.problem("axis", "needs a [controller]");
  }
  for (const TomlTable& table : root.tables("event")) {
    machine.events.push_back(read_event(state, table));
  }
}

}  // namespace thermocomp
