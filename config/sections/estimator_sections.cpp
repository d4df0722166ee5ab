#include "config/sections/estimator_sections.hpp"

#include <algorithm>
#include <map>
#include <set>

#include "config/sections/common.hpp"
#include "config/text/units.hpp"

namespace thermocomp::sections {
namespace {

ScreeningConfig read_screening(const TomlTable& table, const ScreeningConfig& fallback) {
  ScreeningConfig config = fallback;
  read_numbers(table, fallback, config);
  return config;
}

SmoothingConfig read_smoothing(const TomlTable& table, const SmoothingConfig& fallback) {
  SmoothingConfig config = fallback;
  config.form = table.choice<SmoothingForm>("form",
                                            {{"off", SmoothingForm::off},
                                             {"sliding_line", SmoothingForm::sliding_line},
                                             {"line_of_lines", SmoothingForm::line_of_lines}},
                                            fallback.form);
  config.history = table.choice<SmoothingHistory>(
      "history", {{"raw", SmoothingHistory::raw}, {"screened", SmoothingHistory::screened}},
      fallback.history);
  read_numbers(table, fallback, config);
  return config;
}

std::map<std::string, std::size_t> index_of(const std::vector<SensorConfig>& sensors) {
  std::map<std::string, std::size_t> index;
  for (std::size_t i = 0; i < sensors.size(); ++i) index.try_emplace(sensors[i].name, i);
  return index;
}

void read_references(const std::vector<TomlTable>& tables, std::vector<SensorConfig>& sensors) {
  const auto index = index_of(sensors);
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    if (!tables[i].has("reference_sensor")) continue;
    const std::string name = tables[i].text("reference_sensor");
    const auto found = index.find(name);
    if (found == index.end()) {
      if (!name.empty()) tables[i].problem("reference_sensor", "must name a sensor");
    } else if (found->second == i) {
      tables[i].problem("reference_sensor", "must be another sensor");
    } else {
      sensors[i].reference_sensor = found->second;
    }
  }
}

/// Refuses a cycle of reference sensors.
void refuse_cycles(const std::vector<TomlTable>& tables, std::vector<SensorConfig>& sensors) {
  std::vector<bool> in_cycle(sensors.size(), false);
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    auto next = sensors[i].reference_sensor;
    for (std::size_t steps = 0; next && *next != i && steps < sensors.size(); ++steps) {
      next = sensors[*next].reference_sensor;
    }
    in_cycle[i] = next == i;
  }
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    if (!in_cycle[i]) continue;
    tables[i].problem("reference_sensor", "must not lead back to this sensor");
    sensors[i].reference_sensor.reset();
  }
}

}  // namespace

std::vector<SensorConfig> read_sensors(const TomlTable& root,
                                       const std::vector<TomlTable>& tables) {
  const ScreeningConfig screening = read_screening(root.table_or_empty("screening"), {});
  const SmoothingConfig smoothing = read_smoothing(root.table_or_empty("smoothing"), {});
  std::set<std::string> names;
  std::vector<SensorConfig> sensors;
  for (const TomlTable& table : tables) {
    SensorConfig& sensor = sensors.emplace_back();
    sensor.name = unique_name(table, names);
    if (table.has("device")) sensor.module = table.text("device");
    sensor.screening = read_screening(table.table_or_empty("screening"), screening);
    sensor.smoothing = read_smoothing(table.table_or_empty("smoothing"), smoothing);
  }
  read_references(tables, sensors);
  refuse_cycles(tables, sensors);
  return sensors;
}

std::vector<BlockConfig> read_blocks(const std::vector<TomlTable>& tables,
                                     const std::vector<SensorConfig>& sensors) {
  const auto index = index_of(sensors);
  std::set<std::string> names;
  std::vector<BlockConfig> blocks;
  for (const TomlTable& table : tables) {
    BlockConfig& block = blocks.emplace_back();
    block.name = unique_name(table, names);
    block.input = table.text("input");
    if (!block.input.empty() && !is_temperature(block.input)) {
      table.problem("input", "must be a temperature (*_degC, *_K)");
    }
    const std::vector<std::string> named = table.texts("sensors");
    if (table.has("sensors") && named.empty()) {
      table.problem("sensors", "must name at least one sensor");
    }
    for (const std::string& name : named) {
      const auto found = index.find(name);
      if (found == index.end()) {
        if (!name.empty()) table.problem("sensors", name, "must be a sensor's name");
      } else if (std::find(block.sensors.begin(), block.sensors.end(), found->second) !=
                 block.sensors.end()) {
        table.problem("sensors", name, "is named twice");
      } else {
        block.sensors.push_back(found->second);
      }
    }
  }
  return blocks;
}

namespace {

/// Nodes of [axis.table], or both ends of the travel of [axis.line]; empty after a problem.
std::vector<double> read_nodes_mm(const TomlTable& travel, std::string_view key,
                                  std::size_t nodes_max) {
  std::vector<double> nodes_mm = travel.numbers(key, Range::between(-1e6, 1e6));
  if (!travel) return {};
  if (nodes_mm.size() < 2 || nodes_mm.size() > nodes_max) {
    travel.problem(key, nodes_max == 2 ? "must be both ends of the travel"
                                       : "must be 2 to " + std::to_string(nodes_max) + " nodes");
    return {};
  }
  for (std::size_t i = 1; i < nodes_mm.size(); ++i) {
    if (nodes_mm[i] > nodes_mm[i - 1]) continue;
    travel.problem(key, "must increase");
    return {};
  }
  return nodes_mm;
}

std::set<std::string> names_of(const std::vector<TomlTable>& tables) {
  std::set<std::string> names;
  for (const TomlTable& table : tables)
    if (table.is_text("name")) names.insert(table.text("name"));
  return names;
}

/// Nodes of an axis whose controller interpolates along its travel: "x_1", "x_2", ...
/// @param names  of the [[axis]] tables
std::vector<AxisConfig> nodes_of(const TomlTable& table, const AxisConfig& axis,
                                 const std::set<std::string>& names) {
  const bool is_line = table.has("line");
  const std::string_view key = is_line ? "line" : "table";
  if (is_line && table.has("table")) table.refuse("table", "cannot be combined with `line`");
  const TomlTable travel = table.table(key);
  TravelNode node;
  node.axis = axis.name;
  node.form = is_line ? TravelForm::line : TravelForm::table;
  node.position = travel.text("position");
  if (!node.position.empty() && unit_of(node.position).suffix != "_mm")
    travel.problem("position", "must be a position (*_mm) of the model");
  const std::vector<double> nodes_mm =
      is_line ? read_nodes_mm(travel, "travel_mm", 2) : read_nodes_mm(travel, "nodes_mm", axes_max);
  std::vector<AxisConfig> nodes;
  for (const double position_mm : nodes_mm) {
    AxisConfig& each = nodes.emplace_back(axis);
    each.node = node;
    each.node->position_mm = position_mm;
    each.name = axis.name + "_" + std::to_string(nodes.size());
    if (names.contains(each.name))
      table.problem("name", "the nodes of its travel are called " + axis.name + "_1, " + axis.name +
                                "_2, ...: another axis must not be called " + each.name);
  }
  // One axis is kept after a problem, so that the remaining keys can be checked.
  if (nodes.empty()) nodes.push_back(axis);
  return nodes;
}

}  // namespace

std::vector<AxisConfig> read_axes(const std::vector<TomlTable>& tables) {
  std::set<std::string> names;
  std::vector<AxisConfig> axes;
  for (const TomlTable& table : tables) {
    AxisConfig axis;
    axis.name = unique_name(table, names);
    axis.output = table.text("output");
    if (!axis.output.empty() && !is_output(axis.output)) {
      table.problem("output", "must be a displacement (*_um) or a tilt (*_urad)");
    }
    const int sign = table.integer("sign", -1, 1, 1);
    if (sign == 0) table.problem("sign", "must be 1 or -1");
    axis.sign = sign;
    for (const char* key : {"offset_um_max", "rate_um_per_s_max"})  // they have no default
      if (!table.has(key)) table.problem(key, "must be given");
    read_numbers(table, LimiterConfig{}, axis.limiter);
    const bool has_nodes = table.has("line") || table.has("table");
    const bool fitted = axes.size() <= axes_max;
    if (has_nodes) {
      for (AxisConfig& node : nodes_of(table, axis, names_of(tables)))
        axes.push_back(std::move(node));
    } else {
      axes.push_back(std::move(axis));
    }
    if (!fitted || axes.size() <= axes_max) continue;
    std::string rule("there must be at most ");
    rule.append(std::to_string(axes_max)).append(" axes, nodes of travels counted");
    table.problem("name", rule);
  }
  return axes;
}

CompensationConfig read_compensation(const TomlTable& table,
                                     const std::vector<std::string>& signals) {
  CompensationConfig config;
  config.on_loss = table.choice<LossPolicy>(
      "on_loss", {{"hold", LossPolicy::hold}, {"ramp_to_zero", LossPolicy::ramp_to_zero}},
      config.on_loss);
  config.on_stop = table.choice<StopPolicy>(
      "on_stop", {{"hold", StopPolicy::hold}, {"ramp_to_zero", StopPolicy::ramp_to_zero}},
      config.on_stop);
  config.outside_domain = table.choice<OutsidePolicy>("outside_domain",
                                                      {{"warn", OutsidePolicy::warn},
                                                       {"hold", OutsidePolicy::hold},
                                                       {"shrink", OutsidePolicy::shrink}},
                                                      config.outside_domain);
  config.suspected_sensors =
      table.choice<SuspectedPolicy>("suspected_sensors",
                                    {{"off", SuspectedPolicy::off},
                                     {"warn", SuspectedPolicy::warn},
                                     {"weigh_down", SuspectedPolicy::weigh_down}},
                                    config.suspected_sensors);
  config.enabled_at_first_start =
      table.flag("enabled_at_first_start", config.enabled_at_first_start);
  config.estimate_lost_blocks = table.flag("estimate_lost_blocks", config.estimate_lost_blocks);
  config.update = table.choice<UpdateRule>(
      "update", {{"continuous", UpdateRule::continuous}, {"each_cycle", UpdateRule::each_cycle}},
      config.update);
  config.hold_while_cutting = table.flag("hold_while_cutting", config.hold_while_cutting);
  read_numbers(table, CompensationConfig{}, config);
  const auto read_signal = [&](std::string_view key) {
    std::string name = table.text(key, "");
    if (!name.empty() && std::find(signals.begin(), signals.end(), name) == signals.end()) {
      table.problem(key, "must be a signal of the controller: " + listed(signals));
    }
    return name;
  };
  config.cutting_signal = read_signal("cutting_signal");
  config.disable_signal = read_signal("disable_signal");
  config.cycle_end_signal = read_signal("cycle_end_signal");
  if (config.update == UpdateRule::continuous)
    refuse_all(table, {"cycles_per_update", "cycle_ahead"},
               "does not apply with update = \"continuous\"");
  if (config.hold_while_cutting && !table.has("cutting_signal")) {
    table.problem("hold_while_cutting", "needs a cutting_signal");
  }
  return config;
}

CorrectionConfig read_correction(const TomlTable& table) {
  CorrectionConfig config;
  config.form = table.choice<CorrectionForm>("form",
                                             {{"off", CorrectionForm::off},
                                              {"two_phase", CorrectionForm::two_phase},
                                              {"recursive", CorrectionForm::recursive},
                                              {"constant", CorrectionForm::constant}},
                                             config.form);
  config.measured = table.choice<MeasuredMeaning>(
      "measured", {{"remaining", MeasuredMeaning::remaining}, {"total", MeasuredMeaning::total}},
      config.measured);
  config.first_gain = table.choice<FirstGain>("first_gain",
                                              {{"consistent", FirstGain::consistent},
                                               {"eq_34", FirstGain::eq_34},
                                               {"eq_31", FirstGain::eq_31}},
                                              config.first_gain);
  read_numbers(table, CorrectionConfig{}, config);
  for (const TomlTable& group : table.tables("group"))
    config.groups.push_back(group.texts("inputs"));
  const std::size_t count = config.groups.size();
  if (config.form == CorrectionForm::two_phase && count != 2)
    table.problem("group", std::to_string(count),
                  "must be two for form = \"two_phase\": the heat source's inputs, then the tie's");
  if ((config.form == CorrectionForm::recursive || config.form == CorrectionForm::constant) &&
      (count < 1 || count > correction_groups_max))
    table.problem("group", std::to_string(count),
                  "must be 1 to 4 for form = \"recursive\" and \"constant\"");
  return config;
}

void check_correction(const TomlTable& table, const CorrectionConfig& config,
                      const ThermalModel& model) {
  if (model.course && config.form != CorrectionForm::off && model.course->groups != config.groups)
    table.problem("group", "must be the groups of the model's [course], in its order");
  std::set<std::string> named;
  const std::vector<TomlTable> groups = table.tables("group");
  for (std::size_t i = 0; i < config.groups.size(); ++i) {
    for (const std::string& name : config.groups[i]) {
      if (std::find(model.inputs.begin(), model.inputs.end(), name) == model.inputs.end())
        groups[i].problem("inputs", name, "must be an input of the model");
      else if (!named.insert(name).second)
        groups[i].problem("inputs", name, "is named already");
    }
  }
}

}  // namespace thermocomp::sections
