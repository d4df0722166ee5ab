/// The parts of the machine file's reader. Only for the files of this folder.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "config/buses/presets.hpp"
#include "config/toml/toml_reader.hpp"
#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

/// The lists open_circuit_codes, short_circuit_codes, over_range_codes, under_range_codes and
/// error_codes of a table; none of them is required.
[[nodiscard]] FaultCodes read_fault_codes(const TomlTable& table, std::int64_t low,
                                          std::int64_t high);

/// A status beside a value: a bit that is 1 at any fault unless codes are listed, or a register.
[[nodiscard]] SimulatedStatus read_simulated_status(const TomlTable& table);

/// The numbers of a status beside a value in a frame; its place is read elsewhere.
[[nodiscard]] CanStatusCodes read_can_status_codes(const TomlTable& table);

/// Which registers of a unit are taken. Bits of one register may belong to several statuses.
class RegistersTaken {
 public:
  /// @return whether all bits of `mask` were free in these words; takes them
  bool take(int unit, ModbusTable table, std::size_t address, std::size_t count,
            std::uint16_t mask = 0xFFFF);

 private:
  std::map<std::tuple<int, int, std::size_t>, std::uint16_t> words_;
};

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
