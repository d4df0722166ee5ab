#include "modelling/identification/gate/gate_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "config/toml/toml_reader.hpp"

namespace thermocomp::identification {
namespace {

constexpr std::size_t ties_max = 64;
// Default ranges of a tie.
constexpr double lowest_tie = 0.2;  // of the working height
constexpr double highest_tie = 1.5;
constexpr double area_factor = 4.0;

Range length() {
  return Range::above(0, 1e5);
}

/// Properties of a column's section other than its stiffness.
struct Section {
  std::optional<double> depth_mm;  ///< empty: only the inertia is given
  double shear_area_mm2{0.0};
  bool solid{false};
};

Section read_section(const TomlTable& column, TiedColumns& columns) {
  columns.column_width_mm = column.number("width_mm", length());
  Section section;
  const bool by_section = column.has("depth_mm");
  if (by_section)
    for (const char* key : {"inertia_mm4", "shear_area_mm2"})
      column.refuse(key, "must be left out where depth_mm is given");
  if (by_section) {
    const double depth_mm = column.number("depth_mm", length());
    const double width_mm = columns.column_width_mm;
    const double wall_mm = column.number("wall_mm", length(), std::max(width_mm, depth_mm));
    section = {depth_mm, rectangle_shear_area_mm2(width_mm, depth_mm, wall_mm),
               2.0 * wall_mm >= std::min(width_mm, depth_mm)};
    const double inner_width_mm = std::max(0.0, width_mm - 2.0 * wall_mm);
    const double inner_depth_mm = std::max(0.0, depth_mm - 2.0 * wall_mm);
    columns.column_inertia_mm4 =
        (depth_mm * std::pow(width_mm, 3) - inner_depth_mm * std::pow(inner_width_mm, 3)) / 12.0;
  } else {
    columns.column_inertia_mm4 = column.number("inertia_mm4", Range::above(0));
    if (column.has("shear_area_mm2"))
      section.shear_area_mm2 = column.number("shear_area_mm2", Range::above(0));
  }
  return section;
}

double read_held_foot_mm(const TomlTable& column, const Section& section,
                         const TiedColumns& columns) {
  if (!section.solid) {
    column.problem("foot", "\"held\" is only for solid columns: depth_mm without wall_mm");
    return 0.0;
  }
  const double slender = *section.depth_mm / columns.column_width_mm;
  if (!(slender >= 0.1 && slender <= 2.0 && columns.column_poisson_ratio <= 0.4))
    column.problem("foot",
                   "\"held\" is only for depth_mm from 0.1 to 2 width_mm and poisson_ratio up to "
                   "0.4");
  return held_foot_length_mm(columns.column_width_mm, *section.depth_mm,
                             columns.column_poisson_ratio);
}

/// Elasticity that the publication neglects: shear, and a foot that holds its section.
void read_elasticity(const TomlTable& column, const Section& section, TiedColumns& columns) {
  enum class Foot : std::uint8_t { free, held };
  const auto foot =
      column.choice<Foot>("foot", {{"free", Foot::free}, {"held", Foot::held}}, Foot::free);
  if (!column.has("poisson_ratio")) {
    column.refuse("shear_area_mm2", "must be left out where there is no poisson_ratio");
    if (foot == Foot::held) column.problem("foot", "\"held\" needs poisson_ratio");
    return;
  }
  columns.column_poisson_ratio = column.number("poisson_ratio", Range::between(0, 0.49));
  if (!(section.shear_area_mm2 > 0.0)) {
    column.problem("poisson_ratio", "needs depth_mm, or shear_area_mm2 beside inertia_mm4");
    return;
  }
  columns.column_shear_compliance_per_N = 2.0 * (1.0 + columns.column_poisson_ratio) /
                                          (columns.column_modulus_MPa * section.shear_area_mm2);
  if (foot == Foot::held) columns.foot_length_mm = read_held_foot_mm(column, section, columns);
}

Section read_column(const TomlTable& column, TiedColumns& columns) {
  const Section section = read_section(column, columns);
  columns.column_modulus_MPa = column.number("modulus_MPa", Range::above(0, 1e7));
  columns.column_expansion_per_K = column.number("expansion_per_K", Range::above(0, 1e-3));
  read_elasticity(column, section, columns);
  return section;
}

Bounds bounds_of(const TomlTable& table, const char* key, Range range, Bounds otherwise) {
  const std::vector<double> pair = table.numbers(key, range, {otherwise.low, otherwise.high});
  if (pair.size() != 2 || !(pair[0] <= pair[1])) {
    table.problem(key, "must be two numbers, the lowest and the highest");
    return otherwise;
  }
  return {pair[0], pair[1]};
}

/// Names of columns; an empty list is a problem.
std::vector<std::string> columns_in(const TomlTable& table, const char* key,
                                    const std::string& otherwise) {
  std::vector<std::string> names = table.texts(key, {otherwise});
  if (names.empty()) table.problem(key, "must name at least one column");
  return names;
}

/// Thickness of a bonded tie; 0: pinned.
double read_thickness_mm(const TomlTable& table, double area_mm2, const Section& section,
                         const TiedColumns& columns) {
  if (!table.has("thickness_mm")) return 0.0;
  const double thickness_mm = table.number("thickness_mm", length());
  if (!(columns.column_shear_compliance_per_N > 0.0))  // set with poisson_ratio only
    table.problem("thickness_mm", "needs poisson_ratio in [column]");
  if (section.depth_mm && area_mm2 / thickness_mm > *section.depth_mm * (1.0 + 1e-9))
    table.problem("thickness_mm", "makes the tie, area_mm2 / thickness_mm, deeper than the column");
  return thickness_mm;
}

void read_tie(const TomlTable& table, double height_mm, const std::string& temperature,
              const Section& section, GateFile& file) {
  const TiedColumns& columns = file.columns;
  Tie tie;
  tie.height_mm = height_mm;
  tie.length_mm = table.number("length_mm", length());
  tie.area_mm2 = table.number("area_mm2", Range::above(0));
  tie.thickness_mm = read_thickness_mm(table, tie.area_mm2, section, columns);
  tie.modulus_MPa = table.number("modulus_MPa", Range::above(0, 1e7), columns.column_modulus_MPa);
  tie.expansion_per_K =
      table.number("expansion_per_K", Range::above(0, 1e-3), columns.column_expansion_per_K);
  TieChoice choice;
  choice.temperatures = columns_in(table, "temperatures", temperature);
  choice.rise_factor = table.number("rise_factor", Range::between(0, 100), 1.0);
  if (table.flag("fixed", false)) {
    for (const char* key : {"height_mm_range", "area_mm2_range"})
      table.refuse(key, "must be left out where fixed = true");
    choice.height_mm = {tie.height_mm, tie.height_mm};
    choice.area_mm2 = {tie.area_mm2, tie.area_mm2};
  } else {
    const double l = columns.working_height_mm;
    choice.height_mm =
        bounds_of(table, "height_mm_range", length(), {lowest_tie * l, highest_tie * l});
    choice.area_mm2 = bounds_of(table, "area_mm2_range", Range::above(0),
                                {tie.area_mm2 / area_factor, tie.area_mm2 * area_factor});
  }
  file.columns.ties.push_back(tie);
  file.choices.push_back(std::move(choice));
}

void read_ties(const TomlTable& root, const Section& section, GateFile& file) {
  if (!root.has("tie") || root.is_table("tie")) {
    const double height_mm = root.number("tie_height_mm", length());
    read_tie(root.table("tie"), height_mm, "tie_degC", section, file);
    return;
  }
  root.refuse("tie_height_mm", "must be left out where there are [[tie]], each with height_mm");
  const std::vector<TomlTable> ties = root.tables_required("tie");
  if (ties.size() > ties_max) root.problem("tie", "must be at most 64 ties");
  for (std::size_t i = 0; i < ties.size(); ++i)
    read_tie(ties[i], ties[i].number("height_mm", length()),
             ties.size() == 1 ? "tie_degC" : "tie_" + std::to_string(i + 1) + "_degC", section,
             file);
}

GateFile read(const TomlDocument& document) {
  const TomlTable root = document.root();
  GateFile file;
  file.name = document.name();
  file.columns.working_height_mm = root.number("working_height_mm", length());
  file.columns.heated_height_mm = root.number("heated_height_mm", length());
  if (file.columns.heated_height_mm > file.columns.working_height_mm)
    root.problem("heated_height_mm", "must not be above working_height_mm");
  const Section section = read_column(root.table("column"), file.columns);
  read_ties(root, section, file);
  const TomlTable course = root.table_or_empty("course");
  file.side_a = columns_in(course, "side_a", "side_a_degC");
  file.side_b = columns_in(course, "side_b", "side_b_degC");
  document.finish();
  return file;
}

}  // namespace

GateFile load_gate_file(const std::filesystem::path& path) {
  return read(TomlDocument::from_file(path));
}

GateFile parse_gate_file(const std::string& text, const std::string& name) {
  return read(TomlDocument::from_text(text, name));
}

}  // namespace thermocomp::identification
