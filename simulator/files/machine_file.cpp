#include "simulator/files/machine_file.hpp"

#include <algorithm>

#include "simulator/files/machine_file_parts.hpp"

namespace thermocomp {
namespace {

MachineConfig read_machine(const TomlDocument& document, sections::Presets presets) {
  const TomlTable root = document.root();
  MachineConfig machine;
  (void)root.integer("format", 1, 1);
  machine.seed =
      static_cast<std::uint64_t>(root.integer<std::int64_t>("seed", 0, 1'000'000'000'000, 1));
  machine.duration_s = 3600.0 * root.number("duration_h", Range::between(0.0, 1e5), 0.0);
  machine.pitch_s = root.number("pitch_s", Range::between(0.01, 86400.0), 10.0);
  if (root.has("plant"))
    machine.plant = read_plant(root, std::filesystem::path(document.name()).parent_path());
  read_devices(root, presets, machine);
  read_field_nodes(root, presets, machine);
  presets.ignore_rest();  // not every key of a device is a simulated one's
  std::vector<Problem> problems = document.all_problems();
  const std::vector<Problem> preset_problems = presets.problems();
  problems.insert(problems.end(), preset_problems.begin(), preset_problems.end());
  if (!problems.empty()) throw ConfigurationError(std::move(problems));
  return machine;
}

}  // namespace

std::string NameList::read(const TomlTable& table) {
  std::string name = table.text("name");
  if (std::find(names_.begin(), names_.end(), name) != names_.end()) {
    table.problem("name", "is used twice");
  }
  names_.push_back(name);
  return name;
}

std::size_t NameList::index(const TomlTable& table, std::string_view key,
                            std::string_view what) const {
  return index_of(table, key, table.text(key), what);
}

std::size_t NameList::index_of(const TomlTable& table, std::string_view key,
                               const std::string& name, std::string_view what) const {
  const auto found = std::find(names_.begin(), names_.end(), name);
  if (found != names_.end()) return static_cast<std::size_t>(found - names_.begin());
  std::string rule = "must name a " + std::string(what);
  const std::string near = nearest_name(name, names_);
  if (!near.empty()) rule += "; did you mean \"" + near + "\"?";
  if (table.has(key)) table.problem(key, name, rule);
  return 0;
}

MachineConfig load_machine(const std::filesystem::path& path) {
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  return read_machine(TomlDocument::from_file(path),
                      sections::Presets(sections::preset_folders(folder)));
}

MachineConfig parse_machine(std::string text, std::string name) {
  return read_machine(TomlDocument::from_text(std::move(text), std::move(name)),
                      sections::Presets({}));
}

}  // namespace thermocomp
