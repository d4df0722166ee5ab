#include <algorithm>

#include "config/text/units.hpp"
#include "simulator/files/machine_file_parts.hpp"

namespace thermocomp {
namespace {

void read_signal_steps(const TomlTable& table, SignalConfig& signal) {
  signal.times_s = table.numbers("times_s", Range::between(0.0, large));
  signal.values = table.numbers("values", Range::between(-large, large));
  signal.repeat_s = table.number("repeat_s", Range::between(0.0, large), 0.0);
  if (signal.times_s.empty() || signal.times_s.size() != signal.values.size()) {
    table.problem("values", "must have as many numbers as times_s, at least one");
    signal.times_s = {0.0};
    signal.values = {0.0};
  }
  if (signal.times_s.front() != 0.0) table.problem("times_s", "must begin with 0");
  const auto falls = std::adjacent_find(signal.times_s.begin(), signal.times_s.end(),
                                        [](double a, double b) { return !(a < b); });
  if (falls != signal.times_s.end()) table.problem("times_s", "must increase");
  if (signal.repeat_s > 0.0 && !(signal.repeat_s > signal.times_s.back())) {
    table.problem("repeat_s", "must be greater than the last of times_s");
  }
}

void read_signal_random(const TomlTable& table, SignalConfig& signal) {
  signal.values = table.numbers("values", Range::between(-large, large));
  if (signal.values.empty()) {
    table.problem("values", "must have at least one number");
    signal.values = {0.0};
  }
  signal.dwell_s_min = table.number("dwell_s_min", Range::between(0.1, large));
  signal.dwell_s_max = table.number("dwell_s_max", Range::between(0.1, large));
  if (!(signal.dwell_s_max >= signal.dwell_s_min)) {
    table.problem("dwell_s_max", "must not be less than dwell_s_min");
  }
}

SignalConfig read_signal(const TomlTable& table, NameList& signals) {
  SignalConfig signal;
  const NameList earlier = signals;
  signal.name = signals.read(table);
  if (!is_column_name(signal.name)) {
    table.problem("name", column_name_rule);
  } else if (!is_operating(signal.name)) {
    table.problem("name", "must be an operating signal or position, not a temperature or output");
  }
  signal.kind = table.choice<SignalKind>("kind", {{"steps", SignalKind::steps},
                                                  {"line", SignalKind::line},
                                                  {"random", SignalKind::random},
                                                  {"sine", SignalKind::sine},
                                                  {"while_above", SignalKind::while_above}});
  switch (signal.kind) {
    case SignalKind::steps:
    case SignalKind::line:
      read_signal_steps(table, signal);
      break;
    case SignalKind::random:
      read_signal_random(table, signal);
      break;
    case SignalKind::sine:
      signal.centre = table.number("centre", Range::between(-large, large), 0.0);
      signal.amplitude = table.number("amplitude", Range::between(0.0, large));
      signal.period_s = table.number("period_s", Range::between(0.1, large));
      break;
    case SignalKind::while_above:
      signal.watched = earlier.index(table, "signal", "signal above");
      signal.above = table.number("above", Range::between(-large, large), 0.0);
      break;
  }
  return signal;
}

RoomConfig read_room(const TomlTable& table) {
  RoomConfig room;
  room.mean_degC = table.number("mean_degC", Range::between(-20.0, 60.0), room.mean_degC);
  room.daily_swing_K = table.number("daily_swing_K", Range::between(0.0, 30.0), 0.0);
  room.warmest_h = table.number("warmest_h", Range::between(0.0, 24.0), room.warmest_h);
  room.start_h = table.number("start_h", Range::between(0.0, 24.0), room.start_h);
  room.wander_K = table.number("wander_K", Range::between(0.0, 10.0), 0.0);
  room.wander_tau_s = table.number("wander_tau_s", Range::between(1.0, large), room.wander_tau_s);
  for (const TomlTable& entry : table.tables("draught")) {
    DraughtConfig draught;
    draught.at_s = entry.number("at_s", Range::between(0.0, large));
    draught.duration_s = entry.number("duration_s", Range::above(0.0, large));
    draught.change_K = entry.number("change_K", Range::between(-40.0, 40.0));
    room.draughts.push_back(draught);
  }
  return room;
}

NodeConfig read_node(const TomlTable& table, NameList& nodes, const NameList& outputs) {
  NodeConfig node;
  node.name = nodes.read(table);
  if (node.name == "room" || node.name == "coolant") {
    table.problem("name", "must not be \"room\" or \"coolant\", which are reserved");
  }
  node.block = table.text("block", "");
  node.capacity_J_per_K = table.number("capacity_J_per_K", Range::above(0.0, large));
  node.room_W_per_K = table.number("room_W_per_K", Range::between(0.0, large), 0.0);
  node.coolant_W_per_K = table.number("coolant_W_per_K", Range::between(0.0, large), 0.0);
  const TomlTable coefficients = table.table_or_empty("displacement_um_per_K");
  for (const std::string& output : coefficients.keys()) {
    const double value = coefficients.number(output, Range::between(-1e6, 1e6));
    (void)outputs.index_of(coefficients, output, output, "output");
    node.displacement_um_per_K[output] = value;
  }
  return node;
}

LinkConfig read_link(const TomlTable& table, const NameList& nodes) {
  LinkConfig link;
  const std::vector<std::string> ends = table.texts("between");
  if (ends.size() != 2 || ends[0] == ends[1]) {
    table.problem("between", "must be two different nodes");
  } else {
    link.first = nodes.index_of(table, "between", ends[0], "node");
    link.second = nodes.index_of(table, "between", ends[1], "node");
  }
  link.conductance_W_per_K = table.number("conductance_W_per_K", Range::above(0.0, large));
  return link;
}

HeatSourceConfig read_source(const TomlTable& table, const NameList& nodes,
                             const NameList& signals) {
  HeatSourceConfig source;
  source.node = nodes.index(table, "node", "node");
  source.signal = signals.index(table, "signal", "signal");
  source.heat_W = table.number("heat_W", Range::between(-large, large));
  source.at = table.number("at", Range::above(0.0, large));
  source.exponent = table.number("exponent", Range::above(0.0, 5.0), 1.0);
  return source;
}

PositionEffectConfig read_position_effect(const TomlTable& table, const NameList& nodes,
                                          const NameList& signals, const NameList& outputs) {
  PositionEffectConfig effect;
  effect.output = outputs.index(table, "output", "output");
  effect.node = nodes.index(table, "node", "node");
  effect.signal = signals.index(table, "axis", "signal");
  effect.centre_mm = table.number("centre_mm", Range::between(-large, large), 0.0);
  effect.um_per_K_per_m = table.number("um_per_K_per_m", Range::between(-1e6, 1e6));
  return effect;
}

ThermocoupleConfig read_thermocouple(const TomlTable& table, NameList& thermocouples,
                                     const NameList& nodes) {
  using Place = ThermocoupleConfig::Place;
  ThermocoupleConfig thermocouple;
  thermocouple.name = thermocouples.read(table);
  if (!is_column_name(thermocouple.name)) table.problem("name", column_name_rule);
  const std::string node = table.text("node");
  thermocouple.place = node == "room"      ? Place::room
                       : node == "coolant" ? Place::coolant
                                           : Place::node;
  if (thermocouple.place == Place::node) thermocouple.node = nodes.index(table, "node", "node");
  thermocouple.noise_K = table.number("noise_K", Range::between(0.0, 100.0), 0.0);
  thermocouple.lag_s = table.number("lag_s", Range::between(0.0, large), 0.0);
  thermocouple.offset_K = table.number("offset_K", Range::between(-100.0, 100.0), 0.0);
  thermocouple.resolution_K = table.number("resolution_K", Range::between(0.0, 10.0), 0.0);
  thermocouple.conversion_s = table.number("conversion_s", Range::above(0.0, large), 1.0);
  return thermocouple;
}

/// Assigns the body's sources to signals, and its rows to outputs.
void read_body_of(const TomlTable& table, const std::filesystem::path& folder,
                  const NameList& signals, PlantConfig& plant) {
  const std::string file = table.text("body");
  if (file.empty()) return;
  plant.body = load_body(folder / file);
  for (const BodySource& source : plant.body->sources) {
    plant.body_signals.push_back(
        source.signal ? signals.index_of(table, "body", *source.signal, "signal") : 0);
  }
  for (const OutputConfig& output : plant.outputs) {
    const auto& rows = plant.body->outputs;
    const auto found = std::find_if(rows.begin(), rows.end(),
                                    [&](const BodyRow& row) { return row.name == output.name; });
    if (found == rows.end()) table.problem("body", output.name, "the body has no such output");
    plant.body_outputs.push_back(static_cast<std::size_t>(found - rows.begin()));
  }
  for (const BodyGuideway& guideway : plant.body->guideways)
    plant.body_axes.push_back(signals.index_of(table, "body", guideway.axis, "signal"));
}

void read_lumps(const TomlTable& root, const NameList& signals, const NameList& outputs,
                NameList& nodes, PlantConfig& plant) {
  for (const TomlTable& table : root.tables_required("node")) {
    plant.nodes.push_back(read_node(table, nodes, outputs));
  }
  for (const TomlTable& table : root.tables("link")) {
    plant.links.push_back(read_link(table, nodes));
  }
  for (const TomlTable& table : root.tables("source")) {
    plant.sources.push_back(read_source(table, nodes, signals));
  }
  for (const TomlTable& table : root.tables("position_effect")) {
    plant.position_effects.push_back(read_position_effect(table, nodes, signals, outputs));
  }
}

}  // namespace

PlantConfig read_plant(const TomlTable& root, const std::filesystem::path& folder) {
  PlantConfig plant;
  NameList signals;
  NameList outputs;
  NameList nodes;
  NameList thermocouples;
  const TomlTable own = root.table("plant");
  plant.step_s = own.number("step_s", Range::between(0.001, 3600.0), 1.0);
  for (const TomlTable& table : root.tables("signal")) {
    plant.signals.push_back(read_signal(table, signals));
  }
  plant.room = read_room(root.table_or_empty("room"));
  const TomlTable coolant = root.table_or_empty("coolant");
  plant.coolant.temp_degC = coolant.number("temp_degC", Range::between(-20.0, 60.0), 20.0);
  plant.coolant.room_share = coolant.number("room_share", Range::between(0.0, 1.0), 0.0);
  if (coolant.has("temp_signal")) {
    for (const char* key : {"temp_degC", "room_share"})
      coolant.refuse(key, "the coolant's temperature is a signal (temp_signal)");
    plant.coolant.temp_signal = signals.index(coolant, "temp_signal", "signal");
  }
  if (coolant.has("signal")) plant.coolant.signal = signals.index(coolant, "signal", "signal");
  for (const TomlTable& table : root.tables("output")) {
    OutputConfig output;
    output.name = outputs.read(table);
    if (!is_column_name(output.name)) table.problem("name", column_name_rule);
    if (!is_output(output.name)) table.problem("name", "must end in _um or _urad");
    output.noise_um = table.number("noise_um", Range::between(0.0, 1e6), 0.0);
    plant.outputs.push_back(output);
  }
  if (own.has("body")) {
    for (const char* key : {"node", "link", "source", "position_effect"}) {
      root.refuse(key, "must be omitted with plant.body");
    }
    read_body_of(own, folder, signals, plant);
    if (plant.body) {
      for (const BodyRow& sensor : plant.body->sensors) nodes.add(sensor.name);
    }
  } else {
    read_lumps(root, signals, outputs, nodes, plant);
  }
  for (const TomlTable& table : root.tables("thermocouple")) {
    plant.thermocouples.push_back(read_thermocouple(table, thermocouples, nodes));
  }
  return plant;
}

std::vector<std::string> plant_columns(const PlantConfig& plant) {
  std::vector<std::string> names;
  for (const SignalConfig& signal : plant.signals) names.push_back(signal.name);
  for (const ThermocoupleConfig& thermocouple : plant.thermocouples) {
    names.push_back(thermocouple.name + "_degC");
  }
  for (const OutputConfig& output : plant.outputs) names.push_back(output.name);
  return names;
}

}  // namespace thermocomp
