/// The two halves of the machine file's reader; only machine_file.cpp uses them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/buses/presets.hpp"
#include "config/toml/toml_reader.hpp"
#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

/// Names of one sort, each used once.
class NameList {
 public:
  /// Reads `name`; a problem when it is there already.
  std::string read(const TomlTable& table);
  void add(std::string name) { names_.push_back(std::move(name)); }
  /// Index of the name that `key` of `table` gives; a problem and 0 when there is none such.
  [[nodiscard]] std::size_t index(const TomlTable& table, std::string_view key,
                                  std::string_view what) const;
  [[nodiscard]] std::size_t index_of(const TomlTable& table, std::string_view key,
                                     const std::string& name, std::string_view what) const;
  [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }

 private:
  std::vector<std::string> names_;
};

/// [plant] and what belongs to it. @param folder  where a body's file is sought
[[nodiscard]] PlantConfig read_plant(const TomlTable& root, const std::filesystem::path& folder);
/// Columns that the plant provides, in its order.
[[nodiscard]] std::vector<std::string> plant_columns(const PlantConfig& plant);
/// [[bus]], [[device]], [[channel]], [controller], [[axis]], [[event]].
void read_devices(const TomlTable& root, sections::Presets& presets, MachineConfig& machine);
/// The tables of THERMOCOMP_FIELD_NODES; after the plant.
void read_field_nodes(const TomlTable& root, sections::Presets& presets, MachineConfig& machine);

}  // namespace thermocomp
