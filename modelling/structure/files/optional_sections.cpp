// Optional sections of a structure file: heat conduction with load cases, sensor placement.
#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "config/text/units.hpp"
#include "modelling/structure/files/structure_reading.hpp"

namespace thermocomp::structure {

namespace {

constexpr double steps_max = 1e5;

class HeatReader {
 public:
  HeatReader(const TomlTable& root, StructureSpec& spec) : root_(root), spec_(spec) {}

  void read() {
    const Range air = Range::between(-20, 60);
    spec_.room_degC = root_.table_or_empty("room").number("temp_degC", air, spec_.room_degC);
    spec_.coolant_degC = root_.table_or_empty("coolant").number("temp_degC", air, spec_.room_degC);
    for (const TomlTable& table : root_.tables("convection")) read_convection(table);
    for (const TomlTable& table : root_.tables("heat")) read_heat(table);
    for (const TomlTable& table : root_.tables("load_case")) read_load_case(table);
    for (const TomlTable& table : root_.tables("sensor")) read_sensor(table);
    if (!spec_.load_cases.empty() || !spec_.heats.empty()) check_materials();
    if (!spec_.load_cases.empty() && spec_.convections.empty()) {
      root_.problem("load_case", "a load case needs a [[convection]] that carries heat away");
    }
  }

 private:
  void read_convection(const TomlTable& table) {
    ConvectionSpec convection;
    convection.on = read_region(table, "on", spec_.parts);
    convection.coefficient_W_per_m2_K =
        table.number("coefficient_W_per_m2_K", Range::above(0, 1e5));
    convection.to_coolant = table.choice<bool>("to", {{"room", false}, {"coolant", true}}, false);
    spec_.convections.push_back(std::move(convection));
  }

  void read_heat(const TomlTable& table) {
    HeatSpec heat;
    heat.name = read_unique_name(table, heat_names_);
    heat.on = read_region(table, "on", spec_.parts);
    heat.inside = table.flag("inside", false);
    heat.heat_W = table.number("heat_W", Range::between(-1e6, 1e6));
    if (table.has("signal")) {
      heat.signal = table.text("signal");
      if (!heat.signal->empty() && !(is_column_name(*heat.signal) && is_operating(*heat.signal))) {
        table.problem("signal", "must be an operating signal, as spindle_rpm or pump_on");
      }
      heat.at = table.number("at", Range::above(0, 1e9), 1.0);
      heat.exponent = table.number("exponent", Range::above(0, 5), 1.0);
      signals_.insert(*heat.signal);
    } else {
      table.refuse("at", "a heat without a signal is constant");
      table.refuse("exponent", "a heat without a signal is constant");
    }
    spec_.heats.push_back(std::move(heat));
  }

  void read_load_case(const TomlTable& table) {
    LoadCaseSpec load;
    load.name = read_unique_name(table, case_names_);
    load.steady = table.flag("steady", false);
    if (load.steady) {
      table.refuse("duration_s", "a steady case has no duration");
      table.refuse("step_s", "a steady case has no steps");
      table.refuse("at_s", "a steady case has one moment");
      load.at_s = {0.0};
    } else {
      read_times(table, load);
    }
    const TomlTable signals = table.table_or_empty("signals");
    for (const std::string& name : signals.keys()) {
      load.signals[name] = signals.number(name, Range::between(-1e9, 1e9));
      if (!signals_.contains(name)) signals.problem(name, "no [[heat]] has this signal");
    }
    load.room_change_K = table.number("room_change_K", Range::between(-50, 50), 0.0);
    load.coolant_on = table.flag("coolant_on", false);
    load.left_out = table.flag("left_out", false);
    spec_.load_cases.push_back(std::move(load));
  }

  void read_sensor(const TomlTable& table) {
    SensorSpec sensor;
    sensor.name = read_unique_name(table, sensor_names_);
    if (!sensor.name.empty() && !is_column_name(sensor.name)) {
      table.problem("name", column_name_rule);
    }
    sensor.place.part = read_index(table, "part", names_of(spec_.parts), "part");
    sensor.place.at_m = {read_point_m(table, "at_mm")};
    sensor.place.tolerance_m = mm * table.number("tolerance_mm", Range::between(0, 100), 0.1);
    sensor.place.origin = origin_of(table, "at_mm");
    spec_.sensors.push_back(std::move(sensor));
  }

  static void read_times(const TomlTable& table, LoadCaseSpec& load) {
    load.duration_s = table.number("duration_s", Range::above(0, 1e7));
    load.step_s = table.number("step_s", Range::above(0, 1e6));
    if (table.has("step_s") && table.has("duration_s") &&
        !(load.step_s <= load.duration_s && load.duration_s / load.step_s <= steps_max)) {
      table.problem("step_s", "must give 1 to 100000 steps in duration_s");
    }
    load.at_s = table.numbers("at_s", Range::above(0, 1e7), {load.duration_s});
    if (load.at_s.empty()) table.problem("at_s", "must have at least one moment");
    for (std::size_t i = 0; i < load.at_s.size(); ++i) {
      if (i > 0 && !(load.at_s[i] > load.at_s[i - 1])) {
        table.problem("at_s", "must increase");
        break;
      }
    }
    if (!load.at_s.empty() && !(load.at_s.back() <= load.duration_s * (1.0 + 1e-9))) {
      table.problem("at_s", "must not be later than duration_s");
    }
  }

  void check_materials() const {
    for (const Material& material : spec_.materials) {
      if (material.conductivity_W_per_m_K > 0.0 && material.density_kg_per_m3 > 0.0 &&
          material.heat_capacity_J_per_kg_K > 0.0) {
        continue;
      }
      root_.problem("material", material.name,
                    "needs conductivity_W_per_m_K, density_kg_per_m3 and "
                    "heat_capacity_J_per_kg_K, since there is a [[heat]] or [[load_case]]");
    }
  }

  const TomlTable& root_;
  StructureSpec& spec_;
  std::set<std::string> heat_names_, case_names_, sensor_names_, signals_;
};

}  // namespace

void read_heat_sections(const TomlTable& root, StructureSpec& spec) {
  HeatReader(root, spec).read();
}

namespace {

std::vector<Index> read_blocks(const TomlTable& table, const std::vector<std::string>& known) {
  std::vector<Index> blocks;
  const std::vector<std::string> names = table.texts("blocks");
  if (table.has("blocks") && names.empty()) table.problem("blocks", "must name at least one block");
  for (const std::string& name : names) {
    const auto found = std::find(known.begin(), known.end(), name);
    const auto index = static_cast<Index>(found - known.begin());
    if (found == known.end()) {
      const std::string meant = nearest_name(name, known);
      table.problem("blocks", name,
                    "there is no block of this name" +
                        (meant.empty() ? std::string() : "; did you mean \"" + meant + "\"?"));
    } else if (std::find(blocks.begin(), blocks.end(), index) != blocks.end()) {
      table.problem("blocks", name, "is named twice");
    } else {
      blocks.push_back(index);
    }
  }
  return blocks;
}

std::vector<double> read_percents(const TomlTable& table) {
  std::vector<double> percents =
      table.numbers("percents", Range::between(-100, 100), usual_percents);
  if (percents.empty()) table.problem("percents", "must have at least one number");
  if (std::find(percents.begin(), percents.end(), 0.0) != percents.end()) {
    table.problem("percents", "must not have 0, which changes nothing");
  }
  return percents;
}

}  // namespace

void read_placement_section(const TomlTable& root, StructureSpec& spec) {
  const TomlTable placement = root.table_or_empty("placement");
  spec.sensors_on_surface = placement.flag("on_surface", spec.sensors_on_surface);
  const std::vector<std::string> known = names_of(spec.blocks);
  std::set<std::string> names;
  for (const TomlTable& table : placement.tables("pattern")) {
    spec.patterns.push_back(
        {read_unique_name(table, names), read_blocks(table, known), read_percents(table)});
  }
}

}  // namespace thermocomp::structure
