#include "modelling/structure/files/structure_reading.hpp"

#include <limits>

#include "config/text/printable_text.hpp"

namespace thermocomp::structure {

Origin origin_of(const TomlTable& table, std::string_view key, std::string value) {
  Origin origin{table.line(key), table.path(), std::move(value)};
  if (!key.empty()) origin.key.append(".").append(key);
  return origin;
}

Vec3 read_point_m(const TomlTable& table, std::string_view key) {
  const std::vector<double> values = table.numbers(key, length_range());
  if (values.size() == 3) return {values[0] * mm, values[1] * mm, values[2] * mm};
  if (table.has(key)) table.problem(key, "must be three numbers: x, y, z");
  return {};
}

std::string read_unique_name(const TomlTable& table, std::set<std::string>& names) {
  std::string name = table.text("name");
  if (!name.empty() && !names.insert(name).second) table.problem("name", "is used twice");
  return name;
}

Index read_index(const TomlTable& table, std::string_view key,
                 const std::vector<std::string>& known, std::string_view what) {
  const std::string name = table.text(key);
  const auto found = std::find(known.begin(), known.end(), name);
  if (found != known.end()) return static_cast<Index>(found - known.begin());
  const std::string meant = nearest_name(name, known);
  std::string rule = "there is no ";
  rule.append(what).append(" of this name");
  if (!meant.empty()) rule.append("; did you mean \"").append(meant).append("\"?");
  if (!name.empty()) table.problem(key, rule);
  return 0;
}

Region read_region(const TomlTable& parent, std::string_view key,
                   const std::vector<PartSpec>& parts) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  const TomlTable table = parent.table(key);
  Region region;
  region.within_m = {{-infinite, -infinite, -infinite}, {infinite, infinite, infinite}};
  std::string shown;
  if (table.has("part")) {
    const Index part = read_index(table, "part", names_of(parts), "part");
    region.part = part < parts.size() ? parts[part].name : "";
    shown.append("part ").append(*region.part);
  }
  if (table.has("group")) {
    region.group = table.text("group");
    shown.append(shown.empty() ? "" : ", ").append("group ").append(*region.group);
  }
  for (std::size_t d = 0; d < 3; ++d) {
    if (!table.has(range_keys[d])) continue;
    const std::vector<double> range = table.numbers(range_keys[d], length_range());
    if (range.size() != 2 || !(range[0] <= range[1])) {
      table.problem(range_keys[d], "must be a range: [from, to]");
      continue;
    }
    region.within_m.low_m[d] = range[0] * mm;
    region.within_m.high_m[d] = range[1] * mm;
    shown.append(shown.empty() ? "" : ", ").append(range_keys[d]).append(" ");
    shown.append(number_text(range[0])).append("..").append(number_text(range[1]));
  }
  if (table && shown.empty()) {
    parent.problem(key, "must say where: part, group, x_mm, y_mm or z_mm");
  }
  region.origin = origin_of(parent, key, shown);
  return region;
}

}  // namespace thermocomp::structure
