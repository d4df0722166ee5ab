#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "modelling/structure/files/structure_reading.hpp"

namespace thermocomp::structure {
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
