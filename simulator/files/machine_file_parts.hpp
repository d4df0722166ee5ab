/// Parts of the machine file's reader, for this folder only.
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

inline constexpr double large = 1e9;  ///< limit of numbers without one of their own

inline const Names<ModbusTable> table_names{{"coil", ModbusTable::coil},
                                            {"discrete_input", ModbusTable::discrete_input},
                                            {"holding", ModbusTable::holding},
                                            {"input", ModbusTable::input}};

/// Reads the optional lists open_, short_circuit_codes, over_, under_range_codes and error_codes.
[[nodiscard]] FaultCodes read_fault_codes(const TomlTable& table, std::int64_t low,
                                          std::int64_t high);

/// Reads a value's status: a bit, 1 at any fault unless codes are listed, or a register.
[[nodiscard]] SimulatedStatus read_simulated_status(const TomlTable& table);

/// Reads the codes of a status in a frame, without its place.
[[nodiscard]] CanStatusCodes read_can_status_codes(const TomlTable& table);

/// Registers of a unit in use. Several statuses may use bits of one register.
class RegistersTaken {
 public:
  /// Takes the bits of `mask` in these words. @return all were free
  bool take(int unit, ModbusTable table, std::size_t address, std::size_t count,
            std::uint16_t mask = 0xFFFF);

 private:
  std::map<std::tuple<int, int, std::size_t>, std::uint16_t> words_;
};

class NameList {
 public:
  /// Reads `name`; a duplicate is a problem.
  std::string read(const TomlTable& table);
  void add(std::string name) { names_.push_back(std::move(name)); }
  /// Index of the name in `key` of `table`; if unknown, reports a problem and returns 0.
  [[nodiscard]] std::size_t index(const TomlTable& table, std::string_view key,
                                  std::string_view what) const;
  [[nodiscard]] std::size_t index_of(const TomlTable& table, std::string_view key,
                                     const std::string& name, std::string_view what) const;
  [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }

 private:
  std::vector<std::string> names_;
};

/// Reads [plant] and its tables. @param folder  folder of a body's file
[[nodiscard]] PlantConfig read_plant(const TomlTable& root, const std::filesystem::path& folder);
[[nodiscard]] std::vector<std::string> plant_columns(const PlantConfig& plant);
/// Reads [[bus]], [[device]], [[channel]], [controller], [[axis]], [[event]].
void read_devices(const TomlTable& root, sections::Presets& presets, MachineConfig& machine);
/// Reads the tables of THERMOCOMP_FIELD_NODES; requires the plant.
void read_field_nodes(const TomlTable& root, sections::Presets& presets, MachineConfig& machine);

}  // namespace thermocomp
