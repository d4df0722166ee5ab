/// Helpers shared by the readers of the structure file's sections.
#pragma once

#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <vector>

#include "config/toml/toml_reader.hpp"
#include "modelling/structure/files/structure_spec.hpp"

namespace thermocomp::structure {

constexpr double mm = 1e-3;
constexpr double far_mm = 1e6;  ///< upper bound of lengths: 1 km
constexpr std::array<const char*, 3> range_keys{"x_mm", "y_mm", "z_mm"};

[[nodiscard]] inline Range length_range() {
  return Range::between(-far_mm, far_mm);
}

[[nodiscard]] Origin origin_of(const TomlTable& table, std::string_view key,
                               std::string value = {});

/// Reads three numbers in mm.
[[nodiscard]] Vec3 read_point_m(const TomlTable& table, std::string_view key);

/// Reads `name`; a duplicate in `names` is a problem.
[[nodiscard]] std::string read_unique_name(const TomlTable& table, std::set<std::string>& names);

/// Index in `known` of the name in `key`; if unknown, reports a problem and returns 0.
[[nodiscard]] Index read_index(const TomlTable& table, std::string_view key,
                               const std::vector<std::string>& known, std::string_view what);

template <class Items>
[[nodiscard]] std::vector<std::string> names_of(const Items& items) {
  std::vector<std::string> names;
  names.reserve(items.size());
  for (const auto& item : items) names.push_back(item.name);
  return names;
}

[[nodiscard]] Region read_region(const TomlTable& parent, std::string_view key,
                                 const std::vector<PartSpec>& parts);

/// Reads [room], [coolant], [[convection]], [[heat]], [[load_case]]; after parts and joints.
void read_heat_sections(const TomlTable& root, StructureSpec& spec);

/// Reads [placement] with its [[placement.pattern]]; requires blocks.
void read_placement_section(const TomlTable& root, StructureSpec& spec);

}  // namespace thermocomp::structure
