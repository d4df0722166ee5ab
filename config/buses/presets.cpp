#include "config/buses/presets.hpp"

#include <algorithm>
#include <set>

#include "config/sections/common.hpp"
#include "drivers/sensors/bus_config.hpp"

namespace thermocomp::sections {
namespace {

namespace fs = std::filesystem;

bool is_preset_name(const std::string& name) {
  constexpr std::string_view allowed = "abcdefghijklmnopqrstuvwxyz0123456789_-";
  return !name.empty() && name.find_first_not_of(allowed) == std::string::npos;
}

/// Names of the presets in all folders, for a message.
std::vector<std::string> names_in(const std::vector<fs::path>& folders) {
  std::set<std::string> names;
  for (const fs::path& folder : folders) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
      if (entry.path().extension() == ".toml") names.insert(entry.path().stem().string());
    }
  }
  return {names.begin(), names.end()};
}

std::string unknown_rule(const std::string& name, const std::vector<fs::path>& folders) {
  std::vector<std::string> names = names_in(folders);
  const std::string near = nearest_name(name, names);
  if (!near.empty()) return "is not a preset; did you mean \"" + near + "\"?";
  const auto others = std::stable_partition(
      names.begin(), names.end(),
      [&](const std::string& known) { return known.find(name) != std::string::npos; });
  if (others != names.begin()) names.erase(others, names.end());
  std::string rule = "is not a preset; available: ";
  for (const std::string& known : names) rule.append(known).append(" ");
  if (names.empty()) rule += "none ";
  rule += "(looked in";
  for (const fs::path& folder : folders) rule.append(" ").append(folder.string());
  return rule + ")";
}

/// Reads the required keys that are for people only.
void read_source(const TomlTable& root) {
  static_cast<void>(root.integer("format", 1, 1));
  static_cast<void>(root.text("maker"));
  static_cast<void>(root.text("model"));
  static_cast<void>(root.text("document"));
  static_cast<void>(root.text("section"));
  static_cast<void>(root.texts("not_confirmed", {}));
}

Preset read_preset(const TomlDocument& document) {
  const TomlTable root = document.root();
  Preset preset{document, "", root.table_or_empty("device"), {}, {}, {}, {}};
  read_source(root);
  preset.protocol = root.choice<std::string>(
      "protocol",
      {{"modbus", "modbus"}, {"can", "can"}, {"canopen", "canopen"}, {"j1939", "j1939"}});
  refuse_all(preset.device, {"name", "bus", "preset", "thermocouple"},
             "belongs in the configuration");
  std::set<std::string> types;
  for (const TomlTable& table : root.tables("thermocouple")) {
    preset.thermocouples.emplace(unique_name(table, types), table);
  }
  for (const TomlTable& table : root.tables_required("channel")) {
    const int number = table.integer("channel", 0, 255);
    if (!preset.channels.emplace(number, table).second) table.problem("channel", "is used twice");
  }
  return preset;
}

template <class Entries>
std::string list_keys(const Entries& entries) {
  std::string text;
  for (const auto& [key, entry] : entries) {
    text += text.empty() ? "" : ", ";
    if constexpr (std::is_same_v<std::decay_t<decltype(key)>, int>) {
      text += std::to_string(key);
    } else {
      text += key;
    }
  }
  return text;
}

/// The preset's table for the thermocouple type that `table` names, if any.
const TomlTable* thermocouple_of(const TomlTable& table, const Preset& preset) {
  if (!table.has("thermocouple")) return nullptr;
  if (preset.thermocouples.empty()) {
    table.problem("thermocouple", "does not apply: the module sends degC for every type");
    return nullptr;
  }
  const auto found = preset.thermocouples.find(table.text("thermocouple"));
  if (found != preset.thermocouples.end()) {
    preset.thermocouples_used.insert(found->first);
    return &found->second;
  }
  table.problem("thermocouple", "must be one of " + list_keys(preset.thermocouples));
  return nullptr;
}

}  // namespace

std::vector<fs::path> preset_folders(const fs::path& configuration_folder) {
  std::vector<fs::path> folders{configuration_folder / "devices", "/etc/thermocomp/devices"};
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) {
    folders.push_back(program.parent_path().parent_path() / "share/thermocomp/devices");
  }
  return folders;
}

const Preset* Presets::of_device(const TomlTable& device) {
  if (!device.has("preset")) return nullptr;
  const std::string name = device.text("preset");
  if (folders_.empty() || name.empty()) return nullptr;
  if (const auto found = read_.find(name); found != read_.end()) return found->second.get();
  if (!is_preset_name(name)) {
    device.problem("preset", "must be a name of small letters, digits, _ and -");
    return nullptr;
  }
  for (const fs::path& folder : folders_) {
    const fs::path path = folder / (name + ".toml");
    std::error_code error;
    if (fs::exists(path, error)) return (read_[name] = load(path)).get();
  }
  device.problem("preset", unknown_rule(name, folders_));
  return nullptr;
}

std::shared_ptr<const Preset> Presets::load(const fs::path& path) {
  try {
    return std::make_shared<const Preset>(read_preset(TomlDocument::from_file(path)));
  } catch (const ConfigurationError& error) {
    broken_.insert(broken_.end(), error.problems().begin(), error.problems().end());
    return nullptr;
  }
}

TomlTable Presets::over_preset(const TomlTable& device, const Preset& preset,
                               const std::string& protocol) {
  if (preset.protocol != protocol) {
    device.problem("preset", "is a preset for " + preset.protocol + ", but the bus is " + protocol);
  }
  const TomlTable* thermocouple = thermocouple_of(device, preset);
  return thermocouple == nullptr ? device.over(preset.device)
                                 : device.over(*thermocouple).over(preset.device);
}

TomlTable Presets::over_channel(const TomlTable& sensor, const TomlTable& device,
                                const Preset& preset) {
  const TomlTable* thermocouple = thermocouple_of(sensor, preset);
  if (!preset.thermocouples.empty() && !sensor.has("thermocouple") && !device.has("thermocouple")) {
    sensor.problem("thermocouple", "must be given, here or in the device: one of " +
                                       list_keys(preset.thermocouples));
    sensor.ignore_rest();
  }
  TomlTable typed = thermocouple == nullptr ? sensor : sensor.over(*thermocouple);
  if (!sensor.has("channel")) {
    if (!sensor.has("address")) sensor.problem("channel", "must be given");
    return typed;
  }
  const auto found = preset.channels.find(sensor.integer("channel", 0, 255));
  if (found != preset.channels.end()) {
    preset.channels_used.insert(found->first);
    return typed.over(found->second);
  }
  sensor.problem("channel", "must be a channel of the preset: " + list_keys(preset.channels));
  return typed;
}

std::vector<Problem> Presets::problems() const {
  std::vector<Problem> all = broken_;
  for (const auto& [name, preset] : read_) {
    if (!preset) continue;
    for (const auto& [number, table] : preset->channels) {
      if (!preset->channels_used.contains(number)) table.ignore_rest();
    }
    for (const auto& [type, table] : preset->thermocouples) {
      if (!preset->thermocouples_used.contains(type)) table.ignore_rest();
    }
    const std::vector<Problem> own = preset->document.all_problems();
    all.insert(all.end(), own.begin(), own.end());
  }
  return all;
}

void Presets::ignore_rest() const {
  for (const auto& [name, preset] : read_) {
    if (!preset) continue;
    preset->device.ignore_rest();
    for (const auto& [number, table] : preset->channels) table.ignore_rest();
    for (const auto& [type, table] : preset->thermocouples) table.ignore_rest();
  }
}

}  // namespace thermocomp::sections
