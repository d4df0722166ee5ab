/// Device presets: a module's registers from its manual. A preset is a file,
/// config/devices/NAME.toml; docs/commissioning.md lists its keys.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "config/toml/toml_reader.hpp"

namespace thermocomp::sections {

/// Search path for presets: the folder `devices` next to the configuration,
/// /etc/thermocomp/devices, and share/thermocomp/devices next to the program's folder.
[[nodiscard]] std::vector<std::filesystem::path> preset_folders(
    const std::filesystem::path& configuration_folder);

/// One preset that has been read.
struct Preset {
  TomlDocument document;
  std::string protocol;                            ///< BusKind::protocol
  TomlTable device;                                ///< keys of a [[device]]
  std::map<std::string, TomlTable> thermocouples;  ///< by type; empty: set in the module
  std::map<int, TomlTable> channels;               ///< by the number printed on the module
  /// Those that were used; the others have not been read.
  mutable std::set<std::string> thermocouples_used;
  mutable std::set<int> channels_used;
};

class Presets {
 public:
  /// @param folders  empty: no file is opened, and every preset is unknown without a problem
  explicit Presets(std::vector<std::filesystem::path> folders) : folders_(std::move(folders)) {}

  /// The preset named by a [[device]]; nullptr if it names none or an unreadable one (a problem of
  /// the device, unless there are no folders).
  [[nodiscard]] const Preset* of_device(const TomlTable& device);
  /// The device merged over its preset. Refuses a preset of another protocol than the bus'.
  [[nodiscard]] static TomlTable over_preset(const TomlTable& device, const Preset& preset,
                                             const std::string& protocol);
  /// A [[sensor]] merged over its channel of the preset; reads `channel` and `thermocouple`.
  /// @param device  from over_preset()
  [[nodiscard]] static TomlTable over_channel(const TomlTable& sensor, const TomlTable& device,
                                              const Preset& preset);

  /// Problems of the presets that were used.
  [[nodiscard]] std::vector<Problem> problems() const;
  /// Suppresses problems for unknown keys of presets.
  void ignore_rest() const;

 private:
  [[nodiscard]] std::shared_ptr<const Preset> load(const std::filesystem::path& path);

  std::vector<std::filesystem::path> folders_;
  std::map<std::string, std::shared_ptr<const Preset>> read_;  ///< nullptr: could not be read
  std::vector<Problem> broken_;                                ///< files that are not TOML
};

}  // namespace thermocomp::sections
