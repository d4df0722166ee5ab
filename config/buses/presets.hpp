/// Device presets: what a manufacturer's manual says about a module's registers, written down once.
/// A preset is a file of its own, config/devices/NAME.toml; docs/commissioning.md has its keys.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "config/toml/toml_reader.hpp"

namespace thermocomp::sections {

/// Where presets are looked for, in this order: the folder `devices` beside the configuration,
/// /etc/thermocomp/devices, and share/thermocomp/devices beside the program's own folder.
[[nodiscard]] std::vector<std::filesystem::path> preset_folders(
    const std::filesystem::path& configuration_folder);

/// One preset that has been read.
struct Preset {
  TomlDocument document;
  std::string protocol;                            ///< BusKind::protocol
  TomlTable device;                                ///< keys of a [[device]]
  std::map<std::string, TomlTable> thermocouples;  ///< by type; empty: the module itself knows
  std::map<int, TomlTable> channels;               ///< by the number printed on the module
  /// Those that were asked for: nobody has read what stands in the others.
  mutable std::set<std::string> thermocouples_used;
  mutable std::set<int> channels_used;
};

class Presets {
 public:
  /// @param folders  none: no file is opened, and every preset is unknown without being a problem
  explicit Presets(std::vector<std::filesystem::path> folders) : folders_(std::move(folders)) {}

  /// The preset that a [[device]] names; nullptr where it names none, or none that can be read
  /// (then a problem of the device, unless there are no folders).
  [[nodiscard]] const Preset* of_device(const TomlTable& device);
  /// The device over its preset. Refuses a preset of a protocol other than the bus'.
  [[nodiscard]] static TomlTable over_preset(const TomlTable& device, const Preset& preset,
                                             const std::string& protocol);
  /// A [[sensor]] over its channel of the preset; `channel` and `thermocouple` are read here.
  /// @param device  what over_preset() gave
  [[nodiscard]] static TomlTable over_channel(const TomlTable& sensor, const TomlTable& device,
                                              const Preset& preset);

  /// What is wrong with the presets that were used.
  [[nodiscard]] std::vector<Problem> problems() const;
  /// Does not report keys of presets that nobody asked for.
  void ignore_rest() const;

 private:
  [[nodiscard]] std::shared_ptr<const Preset> load(const std::filesystem::path& path);

  std::vector<std::filesystem::path> folders_;
  std::map<std::string, std::shared_ptr<const Preset>> read_;  ///< nullptr: could not be read
  std::vector<Problem> broken_;                                ///< files that are not TOML
};

}  // namespace thermocomp::sections
