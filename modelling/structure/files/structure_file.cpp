#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "modelling/structure/files/structure_reading.hpp"
#include "modelling/structure/files/structure_spec.hpp"

namespace thermocomp::structure {
namespace {

constexpr double m_per_um = 1e-6;
constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double cells_max = 5e6;

class Reader {
 public:
  Reader(const TomlDocument& document, const std::filesystem::path& path)
      : root_(document.root()), folder_(path.parent_path()) {
    spec_.file = path;
  }

  StructureSpec read() {
    static_cast<void>(root_.integer("format", 1, 1));
    for (const TomlTable& table : root_.tables_required("material")) read_material(table);
    for (const TomlTable& table : root_.tables_required("part")) read_part(table);
    for (const TomlTable& table : root_.tables("support")) read_support(table);
    for (const TomlTable& table : root_.tables("spring")) read_spring(table);
    for (const TomlTable& table : root_.tables("joint")) read_joint(table);
    for (const TomlTable& table : root_.tables("block")) read_block(table);
    for (const TomlTable& table : root_.tables("division")) read_division(table);
    for (const TomlTable& table : root_.tables_required("output")) read_output(table);
    for (const TomlTable& table : root_.tables("guideway")) read_guideway(table);
    if (spec_.blocks.empty()) {
      root_.problem("block", "there must be a [[block]] or a [[division]]");
    }
    check_outputs();
    read_heat_sections(root_, spec_);
    read_placement_section(root_, spec_);
    return std::move(spec_);
  }

 private:
  static Vec3 read_stiffness(const TomlTable& table) {
    const auto values = table.numbers("stiffness_N_per_um", Range::between(0.0, 1e9));
    if (values.size() != 3) {
      if (table.has("stiffness_N_per_um")) {
        table.problem("stiffness_N_per_um", "must be three numbers: along x, y and z");
      }
      return {};
    }
    return {values[0] / m_per_um, values[1] / m_per_um, values[2] / m_per_um};
  }

  /// "x", "-z", or a vector of three numbers, which is normalised.
  static Vec3 read_direction(const TomlTable& table, std::string_view key) {
    if (table.is_text(key)) {
      const Names<int> names{{"x", 1}, {"y", 2}, {"z", 3}, {"-x", -1}, {"-y", -2}, {"-z", -3}};
      const int axis = table.choice<int>(key, names);
      Vec3 direction{};
      direction[static_cast<std::size_t>(std::abs(axis) - 1)] = axis > 0 ? 1.0 : -1.0;
      return direction;
    }
    const std::vector<double> values = table.numbers(key, Range::between(-1e6, 1e6));
    Vec3 direction{};
    if (values.size() == 3) direction = {values[0], values[1], values[2]};
    const double size = length(direction);
    if (size > 0.0) return (1.0 / size) * direction;
    if (table.has(key)) {
      table.problem(key,
                    "must be \"x\", \"y\", \"z\" (with - for the opposite direction) or a vector");
    }
    return {1, 0, 0};
  }

  // ---------------------------------------------------------------- material, part

  void read_material(const TomlTable& table) {
    Material material;
    material.name = read_unique_name(table, material_names_);
    material.youngs_modulus_Pa = 1e9 * table.number("youngs_modulus_GPa", Range::above(0, 2000));
    material.poisson_ratio = table.number("poisson_ratio", Range::between(0, 0.49));
    material.expansion_per_K =
        m_per_um * table.number("expansion_um_per_m_K", Range::between(-50, 200));
    read_thermal_constants(table, material);
    spec_.materials.push_back(material);
  }

  /// Needed only for heat conduction; 0 if absent.
  static void read_thermal_constants(const TomlTable& table, Material& material) {
    const auto constant = [&](std::string_view key, double most) {
      return table.has(key) ? table.number(key, Range::above(0, most)) : 0.0;
    };
    material.conductivity_W_per_m_K = constant("conductivity_W_per_m_K", 5000);
    material.density_kg_per_m3 = constant("density_kg_per_m3", 50000);
    material.heat_capacity_J_per_kg_K = constant("heat_capacity_J_per_kg_K", 20000);
  }

  void read_part(const TomlTable& table) {
    PartSpec part;
    part.name = read_unique_name(table, part_names_);
    part.origin = origin_of(table, "name", part.name);
    part.material = read_index(table, "material", names_of(spec_.materials), "material");
    if (table.has("mesh") == table.has("box")) {
      table.problem("mesh", "a part must have either a mesh or [[part.box]]");
      table.ignore_rest();
    } else if (table.has("mesh")) {
      read_mesh(table, part);
    } else {
      read_boxes(table, part);
    }
    spec_.parts.push_back(std::move(part));
  }

  static Shape read_shape(const TomlTable& table, Shape otherwise) {
    return table.choice<Shape>("element",
                               {{"tet4", Shape::tet4},
                                {"tet10", Shape::tet10},
                                {"hex8", Shape::hex8},
                                {"hex20", Shape::hex20}},
                               otherwise);
  }

  void read_mesh(const TomlTable& table, PartSpec& part) const {
    part.mesh = folder_ / table.text("mesh");
    part.origin = origin_of(table, "mesh", part.mesh.string());
    const std::string ending = part.mesh.extension().string();
    if (table.has("group")) part.group = table.text("group");
    if (ending == ".step" || ending == ".stp") {
      part.size_m.fill(mm * table.number("size_mm", Range::above(0, far_mm)));
      part.shape = read_shape(table, Shape::tet10);
      if (shape_info(part.shape).corners != 4) {
        table.problem("element", "geometry is meshed by tet4 or tet10");
      }
      return;
    }
    if (ending != ".msh" && ending != ".inp") {
      table.problem("mesh", "must end in .msh, .inp, .step or .stp");
    }
    part.length_unit_m = table.choice<double>("length_unit", {{"mm", 1e-3}, {"m", 1.0}}, 1e-3);
  }

  static void read_boxes(const TomlTable& table, PartSpec& part) {
    part.shape = read_shape(table, Shape::hex20);
    const Range size_range = Range::above(0, far_mm);
    std::vector<double> size_mm{1.0, 1.0, 1.0};
    if (table.has("size_mm")) size_mm = table.numbers("size_mm", size_range);
    if (size_mm.size() != 3) table.problem("size_mm", "must be three numbers: along x, y and z");
    if (!table.has("size_mm")) static_cast<void>(table.numbers("size_mm", size_range));
    size_mm.resize(3, 1.0);
    for (std::size_t d = 0; d < 3; ++d) part.size_m[d] = size_mm[d] * mm;
    for (const TomlTable& box : table.tables_required("box")) {
      BoxShape shape{{read_point_m(box, "from_mm"), read_point_m(box, "to_mm")},
                     box.flag("cut", false)};
      for (std::size_t d = 0; d < 3; ++d) {
        if (!(shape.box.low_m[d] < shape.box.high_m[d])) {
          box.problem("to_mm", "must be greater than from_mm in x, y and z");
          break;
        }
      }
      part.boxes.push_back(shape);
    }
    if (table.has("size_mm") && !part.boxes.empty() &&
        !(cells_of_boxes(part.boxes, part.size_m) <= cells_max)) {
      table.problem("size_mm", "is too fine: more than five million elements");
    }
  }

  // ---------------------------------------------------------------- supports

  void read_support(const TomlTable& table) {
    SupportSpec support{read_region(table, "on", spec_.parts), {}};
    const auto directions = table.texts("directions", {"x", "y", "z"});
    if (directions.empty()) table.problem("directions", "must name at least one of x, y, z");
    for (const std::string& direction : directions) {
      if (direction.size() == 1 && direction[0] >= 'x' && direction[0] <= 'z') {
        support.directions[static_cast<std::size_t>(direction[0] - 'x')] = true;
      } else {
        table.problem("directions", direction, "must be x, y or z");
      }
    }
    spec_.supports.push_back(std::move(support));
  }

  void read_spring(const TomlTable& table) {
    spec_.springs.push_back({read_region(table, "on", spec_.parts), read_stiffness(table)});
    if (table.has("stiffness_N_per_um") && spec_.springs.back().stiffness_N_per_m == Vec3{}) {
      table.problem("stiffness_N_per_um", "must be above 0 in some direction");
    }
  }

  void read_joint(const TomlTable& table) {
    JointSpec joint;
    joint.name = read_unique_name(table, joint_names_);
    joint.from = read_region(table, "from", spec_.parts);
    joint.to = read_region(table, "to", spec_.parts);
    joint.bonded = table.choice<bool>("kind", {{"bonded", true}, {"spring", false}}, true);
    if (!joint.bonded) joint.stiffness_N_per_m = read_stiffness(table);
    if (table.has("conductance_W_per_m2_K")) {
      joint.conductance_W_per_m2_K = table.number("conductance_W_per_m2_K", Range::between(0, 1e6));
    }
    joint.gap_m = mm * table.number("gap_mm", Range::between(0, 100), 0.1);
    spec_.joints.push_back(std::move(joint));
  }

  // ---------------------------------------------------------------- blocks

  void add_block_name(const TomlTable& table, std::string_view key, const std::string& name) {
    if (name.empty()) return;  // already reported
    if (!is_column_name(name)) table.problem(key, name, column_name_rule);
    if (!is_temperature(name)) table.problem(key, name, "must be a temperature (*_degC, *_K)");
    if (!block_names_.insert(name).second) table.problem(key, name, "is used twice");
  }

  void read_block(const TomlTable& table) {
    BlockSpec block;
    block.name = table.text("name");
    add_block_name(table, "name", block.name);
    block.rest = table.flag("rest", false);
    if (block.rest) {
      table.refuse("on", "a block with rest = true has all nodes that no other block has");
      block.on.origin = origin_of(table, "rest", "true");
    } else {
      block.on = read_region(table, "on", spec_.parts);
    }
    spec_.blocks.push_back(std::move(block));
  }

  /// Blocks cut from a part by planes: names in the order of x, then y, then z.
  void read_division(const TomlTable& table) {
    const Index part = read_index(table, "part", names_of(spec_.parts), "part");
    std::array<std::vector<double>, 3> cuts;
    std::size_t count = 1;
    for (std::size_t d = 0; d < 3; ++d) {
      cuts[d] = table.numbers(range_keys[d], length_range(), {});
      if (std::adjacent_find(cuts[d].begin(), cuts[d].end(), std::greater_equal<>()) !=
          cuts[d].end()) {
        table.problem(range_keys[d], "must be increasing");
      }
      count *= cuts[d].size() + 1;
    }
    const std::vector<std::string> names = table.texts("names");
    if (table.has("names") && names.size() != count) {
      table.problem("names", std::to_string(names.size()) + " names",
                    "must be " + std::to_string(count) +
                        ": one per block, in the order of x, then y, then z");
      return;
    }
    for (std::size_t i = 0; i < names.size(); ++i) {
      add_block_name(table, "names", names[i]);
      BlockSpec block{names[i], {}, false};
      block.on.part = part < spec_.parts.size() ? spec_.parts[part].name : "";
      block.on.origin = origin_of(table, "names", names[i]);
      std::size_t place = i;
      for (std::size_t d = 0; d < 3; ++d) {
        const std::size_t at = place % (cuts[d].size() + 1);
        place /= cuts[d].size() + 1;
        block.on.within_m.low_m[d] = at == 0 ? -infinite : cuts[d][at - 1] * mm;
        block.on.within_m.high_m[d] = at == cuts[d].size() ? infinite : cuts[d][at] * mm;
      }
      spec_.blocks.push_back(std::move(block));
    }
  }

  // ---------------------------------------------------------------- outputs

  PlaceSpec read_place(const TomlTable& parent, std::string_view key, bool tilt) const {
    const TomlTable table = parent.table(key);
    PlaceSpec place;
    place.sign = key == "work" ? -1.0 : 1.0;
    place.part = read_index(table, "part", names_of(spec_.parts), "part");
    if (tilt) {
      place.at_m = {read_point_m(table, "from_mm"), read_point_m(table, "to_mm")};
      if (table.has("to_mm") && !(length(place.at_m[1] - place.at_m[0]) > 0.0)) {
        table.problem("to_mm", "must be another point than from_mm");
      }
    } else {
      place.at_m = {read_point_m(table, "at_mm")};
    }
    place.tolerance_m = mm * table.number("tolerance_mm", Range::between(0, 100), 0.1);
    place.origin = origin_of(parent, key);
    return place;
  }

  void read_output(const TomlTable& table) {
    OutputSpec output;
    output.name = read_unique_name(table, output_names_);
    if (!output.name.empty() && !is_output(output.name)) {
      table.problem("name", "must be a displacement (*_um) or a tilt (*_urad)");
    }
    if (!output.name.empty() && !is_column_name(output.name)) {
      table.problem("name", column_name_rule);
    }
    const bool tilt = kind_of(output.name) == QuantityKind::tilt;
    output.direction = read_direction(table, "direction");
    for (const char* key : {"tool", "work"}) {
      if (table.has(key)) output.places.push_back(read_place(table, key, tilt));
    }
    spec_.outputs.push_back(std::move(output));
  }

  void read_guideway(const TomlTable& table) {
    GuidewayRows guideway;
    guideway.name = read_unique_name(table, guideway_names_);
    guideway.axis = table.text("axis");
    if (!guideway.axis.empty() && kind_of(guideway.axis) != QuantityKind::position) {
      table.problem("axis", "must be a position, a column *_mm");
    }
    const Index part = read_index(table, "part", names_of(spec_.parts), "part");
    const Vec3 from_m = read_point_m(table, "from_mm");
    const Vec3 to_m = read_point_m(table, "to_mm");
    guideway.positions_mm = table.numbers("positions_mm", length_range());
    const std::vector<double>& at = guideway.positions_mm;
    if (table.has("positions_mm") &&
        (at.size() < 2 ||
         std::adjacent_find(at.begin(), at.end(), std::greater_equal<>()) != at.end())) {
      table.problem("positions_mm", "must be two or more numbers, strictly increasing");
    }
    const bool tool = table.choice<bool>("carries", {{"tool", true}, {"work", false}});
    const double tolerance_m = mm * table.number("tolerance_mm", Range::between(0, 100), 0.1);
    const auto place_at = [&](const char* key, double position) {
      const double fraction = (position - at.front()) / std::max(at.back() - at.front(), 1e-9);
      PlaceSpec place;
      place.part = part;
      place.at_m = {from_m + fraction * (to_m - from_m)};
      place.tolerance_m = tolerance_m;
      place.sign = tool ? 1.0 : -1.0;
      place.origin = origin_of(table, key, number_text(position));
      return place;
    };
    for (const double position : at) guideway.places.push_back(place_at("positions_mm", position));
    if (table.has("drawn_at_mm") && at.size() >= 2) {
      const double drawn = table.number("drawn_at_mm", Range::between(at.front(), at.back()));
      guideway.drawn = place_at("drawn_at_mm", drawn);
    }
    const TomlTable outputs = table.table("outputs");
    if (outputs && outputs.keys().empty()) table.problem("outputs", "must name an output");
    for (const std::string& name : outputs.keys()) {
      guideway.outputs[name] = read_direction(outputs, name);
      if (!output_names_.contains(name) || kind_of(name) != QuantityKind::displacement) {
        outputs.problem(name, "must be the name of an [[output]] that is a displacement (*_um)");
      }
      carried_.insert(name);
    }
    spec_.guideways.push_back(std::move(guideway));
  }

  void check_outputs() {
    for (const OutputSpec& output : spec_.outputs) {
      if (!output.places.empty() || carried_.contains(output.name)) continue;
      root_.problem("output", output.name, "must have tool or work, or a guideway that carries it");
    }
  }

  TomlTable root_;
  std::filesystem::path folder_;
  StructureSpec spec_;
  std::set<std::string> material_names_, part_names_, joint_names_, block_names_, output_names_,
      guideway_names_, carried_;
};

}  // namespace

StructureSpec parse_structure(const std::string& text, const std::filesystem::path& path) {
  const TomlDocument document = TomlDocument::from_text(text, path.string());
  Reader reader(document, path);
  StructureSpec spec = reader.read();
  document.finish();
  return spec;
}

StructureSpec load_structure(const std::filesystem::path& path) {
  return parse_structure(read_text_file(path), path);
}

}  // namespace thermocomp::structure
