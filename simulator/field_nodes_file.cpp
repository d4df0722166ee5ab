#include <algorithm>

#include "simulator/machine_file_parts.hpp"

namespace thermocomp {
namespace {

constexpr double large = 1e9;

std::string read_column(const TomlTable& table, const MachineConfig& machine) {
  std::string column = table.text("column");
  if (!machine.plant || column.empty()) return column;  // a replayed file has its own columns
  const std::vector<std::string> columns = plant_columns(*machine.plant);
  if (std::find(columns.begin(), columns.end(), column) != columns.end()) return column;
  const std::string near = nearest_name(column, columns);
  table.problem("column", near.empty()
                              ? "must be a column of the plant"
                              : "must be a column of the plant; did you mean \"" + near + "\"?");
  return column;
}

bool is_of_channel(NodeEventKind kind) {
  return kind == NodeEventKind::open_circuit || kind == NodeEventKind::short_circuit;
}

NodeEvent read_event(const TomlTable& table, const Names<NodeEventKind>& kinds,
                     std::size_t channels) {
  NodeEvent event;
  event.kind = table.choice("kind", kinds);
  if (is_of_channel(event.kind)) {
    const int count = std::max(1, static_cast<int>(channels));
    event.channel = static_cast<std::size_t>(table.integer("channel", 1, count) - 1);
  } else {
    table.refuse("channel", "is a matter of the whole node");
  }
  event.at_s = table.number("at_s", Range::between(0.0, large), 0.0);
  event.duration_s = table.number("duration_s", Range::above(0.0, large), large);
  return event;
}

SimulatedCanopenNode read_canopen_node(const TomlTable& table, NameList& names,
                                       const MachineConfig& machine) {
  constexpr std::size_t channels_max = 4;
  SimulatedCanopenNode node;
  node.name = names.read(table);
  node.interface = table.text("interface");
  node.node = table.integer("node", 1, 127);
  node.cob_id = table.integer<std::uint32_t>("cob_id", 0x181, 0x57F,
                                             0x180 + static_cast<std::uint32_t>(node.node));
  node.period_s = table.number("period_s", Range::between(0.0, 60.0), node.period_s);
  node.heartbeat_s = table.number("heartbeat_s", Range::between(0.0, 60.0), node.heartbeat_s);
  for (const TomlTable& entry : table.tables_required("channel")) {
    node.channels.push_back({read_column(entry, machine)});
  }
  if (node.channels.size() > channels_max) table.problem("channel", "must be at most 4");
  const Names<NodeEventKind> kinds{{"open_circuit", NodeEventKind::open_circuit},
                                   {"short_circuit", NodeEventKind::short_circuit},
                                   {"heartbeat_loss", NodeEventKind::heartbeat_loss},
                                   {"sdo_abort", NodeEventKind::sdo_abort},
                                   {"silence", NodeEventKind::silence}};
  for (const TomlTable& entry : table.tables("event")) {
    node.events.push_back(read_event(entry, kinds, node.channels.size()));
  }
  return node;
}

SimulatedJ1939Node read_j1939_node(const TomlTable& table, NameList& names,
                                   const MachineConfig& machine) {
  constexpr std::uint32_t pgn_max = 0x3FFFF;
  SimulatedJ1939Node node;
  node.name = names.read(table);
  node.interface = table.text("interface");
  node.address = table.integer("address", 0, 253);
  node.name_claimed =
      static_cast<std::uint64_t>(table.integer<std::int64_t>("j1939_name", 0, INT64_MAX, 0));
  node.period_s = table.number("period_s", Range::between(0.01, 60.0), node.period_s);
  for (const TomlTable& entry : table.tables_required("channel")) {
    J1939NodeChannel channel;
    channel.column = read_column(entry, machine);
    channel.pgn = entry.integer<std::uint32_t>("pgn", 0xF000, pgn_max);
    if (((channel.pgn >> 8) & 0xFFu) < 0xF0u) {
      entry.problem("pgn", "must be a broadcast group: 0xF0 or more in its second byte");
    }
    channel.start_byte = entry.integer("start_byte", 1, 1784) - 1;
    node.channels.push_back(channel);
  }
  const Names<NodeEventKind> kinds{{"open_circuit", NodeEventKind::open_circuit},
                                   {"silence", NodeEventKind::silence}};
  for (const TomlTable& entry : table.tables("event")) {
    node.events.push_back(read_event(entry, kinds, node.channels.size()));
  }
  return node;
}

}  // namespace

void read_field_nodes(const TomlTable& root, MachineConfig& machine) {
  NameList names;
  for (const TomlTable& table : root.tables("canopen_node")) {
    machine.canopen_nodes.push_back(read_canopen_node(table, names, machine));
  }
  for (const TomlTable& table : root.tables("j1939_node")) {
    machine.j1939_nodes.push_back(read_j1939_node(table, names, machine));
  }
}

}  // namespace thermocomp
