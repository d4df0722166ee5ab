#include <algorithm>
#include <type_traits>
#include <utility>

#include "config/buses/canopen_bus.hpp"
#include "config/buses/j1939_bus.hpp"
#include "simulator/files/machine_file_parts.hpp"

namespace thermocomp {
namespace {

std::string read_column(const TomlTable& table, const MachineConfig& machine) {
  std::string column = table.text("column");
  if (!machine.plant || column.empty()) return column;  // a replayed file defines the columns
  const std::vector<std::string> columns = plant_columns(*machine.plant);
  if (std::find(columns.begin(), columns.end(), column) != columns.end()) return column;
  const std::string near = nearest_name(column, columns);
  table.problem("column", near.empty()
                              ? "must be a column of the plant"
                              : "must be a column of the plant; did you mean \"" + near + "\"?");
  return column;
}

const Names<NodeEventKind>& event_kinds() {
  static const Names<NodeEventKind> names{{"open_circuit", NodeEventKind::open_circuit},
                                          {"short_circuit", NodeEventKind::short_circuit},
                                          {"over_range", NodeEventKind::over_range},
                                          {"under_range", NodeEventKind::under_range},
                                          {"channel_error", NodeEventKind::channel_error},
                                          {"heartbeat_loss", NodeEventKind::heartbeat_loss},
                                          {"sdo_abort", NodeEventKind::sdo_abort},
                                          {"silence", NodeEventKind::silence}};
  return names;
}

NodeEvent read_event(const TomlTable& table, std::size_t channels) {
  NodeEvent event;
  event.kind = table.choice("kind", event_kinds());
  if (channel_fault(event.kind)) {
    const int count = std::max(1, static_cast<int>(channels));
    event.channel = static_cast<std::size_t>(table.integer("channel", 1, count) - 1);
    if (table.has("code")) {
      event.code = table.integer<std::int64_t>("code", -(1LL << 40), 1LL << 40);
    }
  } else {
    table.refuse("channel", "must be omitted: the event concerns the whole node");
    table.refuse("code", "must be omitted: it applies to a channel only");
  }
  event.at_s = table.number("at_s", Range::between(0.0, large), 0.0);
  event.duration_s = table.number("duration_s", Range::above(0.0, large), large);
  return event;
}

bool lists(const FaultCodes& codes, const NodeEvent& event) {
  const auto found = codes.find(*channel_fault(event.kind));
  if (found == codes.end()) return false;
  return !event.code ||
         std::find(found->second.begin(), found->second.end(), *event.code) != found->second.end();
}

void check_event(const TomlTable& table, const SimulatedCanopenNode& node, const NodeEvent& event) {
  if (!channel_fault(event.kind) || event.channel >= node.channels.size()) return;
  const CanopenNodeChannel& channel = node.channels[event.channel];
  const bool is_shown =
      node.emergency == EmergencyForm::jumo && !event.code &&
      (event.kind == NodeEventKind::open_circuit || event.kind == NodeEventKind::short_circuit);
  if (is_shown || lists(channel.codes, event) || lists(channel.status.codes, event)) return;
  table.problem(event.code ? "code" : "kind", "is not supported by the channel");
}

void check_event(const TomlTable& table, const SimulatedJ1939Node& node, const NodeEvent& event) {
  if (!channel_fault(event.kind) || event.channel >= node.channels.size()) return;
  const J1939NodeChannel& channel = node.channels[event.channel];
  if (lists(channel.codes, event)) return;
  const int bits = channel.place.length_bits;
  // Codes of the standard: 0xFB and more in the highest byte.
  const bool is_standard = event.code && *event.code >= (std::int64_t{0xFB} << (bits - 8)) &&
                           *event.code < (std::int64_t{1} << bits);
  const bool has_first = !event.code && (event.kind == NodeEventKind::open_circuit ||
                                         event.kind == NodeEventKind::over_range ||
                                         event.kind == NodeEventKind::channel_error);
  if (is_standard || has_first) return;
  table.problem(event.code ? "code" : "kind", "is not supported by the channel");
}

template <class Node>
void read_events(const TomlTable& table, Node& node) {
  for (const TomlTable& entry : table.tables("event")) {
    const NodeEvent event = read_event(entry, node.channels.size());
    check_event(entry, node, event);
    node.events.push_back(event);
  }
}

FaultCodes read_codes(const TomlTable& channel, const TomlTable& device) {
  FaultCodes codes = read_fault_codes(device, INT64_MIN, INT64_MAX);
  for (const auto& [fault, own] : read_fault_codes(channel, INT64_MIN, INT64_MAX)) {
    codes[fault] = own;
  }
  return codes;
}

/// Takes the channel's place and codes from the preset.
void place_channel(const TomlTable& own, const TomlTable& device, const sections::Preset& preset,
                   const sections::CanopenDevice& known, CanopenNodeChannel& channel) {
  const sections::EdsFiles no_files{std::nullopt};
  const TomlTable table = sections::Presets::over_channel(own, device, preset);
  channel.place = sections::read_canopen_channel(table, device, known, no_files);
  if (!channel.place) channel.place.emplace();
  channel.codes = read_codes(table, device);
  const TomlTable& status = table.has("status") ? table : device;
  if (status.has("status")) channel.status = read_can_status_codes(status.table("status"));
}

void read_node(const TomlTable& table, NameList& names, sections::Presets& presets,
               const MachineConfig& machine, SimulatedCanopenNode& node) {
  constexpr std::size_t channels_max = 4;  // 16 bits each in TPDO 1
  node.name = names.read(table);
  node.interface = table.text("interface");
  node.node = table.integer("node", 1, 127);
  node.cob_id = table.integer<std::uint32_t>("cob_id", 0x181, 0x57F,
                                             0x180 + static_cast<std::uint32_t>(node.node));
  node.period_s = table.number("period_s", Range::between(0.0, 60.0), node.period_s);
  node.heartbeat_s = table.number("heartbeat_s", Range::between(0.0, 60.0), node.heartbeat_s);
  const sections::Preset* preset = presets.of_device(table);
  const TomlTable device =
      preset == nullptr ? table : sections::Presets::over_preset(table, *preset, "canopen");
  sections::CanopenDevice known;
  known.node.node = node.node;
  known.node.mappings_read = {1};
  if (preset != nullptr) node.emergency = sections::read_emergency_form(device);
  known.node.emergency = node.emergency;
  for (const TomlTable& entry : table.tables_required("channel")) {
    CanopenNodeChannel& channel = node.channels.emplace_back();
    channel.column = read_column(entry, machine);
    if (preset != nullptr) place_channel(entry, device, *preset, known, channel);
  }
  if (preset == nullptr && node.channels.size() > channels_max) {
    table.problem("channel", "must be at most 4");
  }
  read_events(table, node);
}

/// Reads a channel's place in its group; default: the standard's two-byte temperature.
J1939NodeChannel read_j1939_place(const TomlTable& own, const TomlTable& device,
                                  const sections::Preset* preset) {
  J1939NodeChannel channel;
  if (preset != nullptr) {
    const TomlTable table = sections::Presets::over_channel(own, device, *preset);
    channel.place = sections::read_j1939_channel(table, device).parameter;
    channel.codes = read_codes(table, device);
    if (channel.place.length_bits % 8 != 0 || channel.place.start_bit != 0) {
      own.problem("channel", "must consist of whole bytes in a simulated node");
      channel.place.length_bits = 16;
    }
  } else {
    constexpr std::uint32_t pgn_max = 0x3FFFF;
    channel.place.pgn = own.integer<std::uint32_t>("pgn", 0xF000, pgn_max);
    channel.place.start_byte = own.integer("start_byte", 1, 1784) - 1;
    channel.place.scale = 0.03125;
    channel.place.offset = -273.0;
  }
  if (((channel.place.pgn >> 8) & 0xFFu) < 0xF0u) {
    own.problem("pgn", "must be a broadcast group: 0xF0 or more in its second byte");
  }
  return channel;
}

void read_node(const TomlTable& table, NameList& names, sections::Presets& presets,
               const MachineConfig& machine, SimulatedJ1939Node& node) {
  node.name = names.read(table);
  node.interface = table.text("interface");
  node.address = table.integer("address", 0, 253);
  node.name_claimed =
      static_cast<std::uint64_t>(table.integer<std::int64_t>("j1939_name", 0, INT64_MAX, 0));
  node.period_s = table.number("period_s", Range::between(0.01, 60.0), node.period_s);
  const sections::Preset* preset = presets.of_device(table);
  const TomlTable device =
      preset == nullptr ? table : sections::Presets::over_preset(table, *preset, "j1939");
  for (const TomlTable& entry : table.tables_required("channel")) {
    const std::string column = read_column(entry, machine);
    node.channels.push_back(read_j1939_place(entry, device, preset));
    node.channels.back().column = column;
  }
  read_events(table, node);
}

}  // namespace

std::optional<ChannelFault> channel_fault(NodeEventKind kind) {
  switch (kind) {
    case NodeEventKind::open_circuit:
      return ChannelFault::open_circuit;
    case NodeEventKind::short_circuit:
      return ChannelFault::short_circuit;
    case NodeEventKind::over_range:
      return ChannelFault::over_range;
    case NodeEventKind::under_range:
      return ChannelFault::under_range;
    case NodeEventKind::channel_error:
      return ChannelFault::error;
    case NodeEventKind::heartbeat_loss:
    case NodeEventKind::sdo_abort:
    case NodeEventKind::silence:
      break;
  }
  return std::nullopt;
}

void read_field_nodes(const TomlTable& root, sections::Presets& presets, MachineConfig& machine) {
  NameList names;
  const auto read_all = [&]<class Node>(const char* tables, Node empty) {
    for (const TomlTable& table : root.tables(tables)) {
      Node node = empty;
      read_node(table, names, presets, machine, node);
      machine.field_nodes.push_back(std::move(node));
    }
  };
  read_all("canopen_node", SimulatedCanopenNode{});
  read_all("j1939_node", SimulatedJ1939Node{});
}

}  // namespace thermocomp
