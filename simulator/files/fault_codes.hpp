/// The codes that a simulated device shows in place of a temperature, as its file or preset lists
/// them.
#pragma once

#include <map>
#include <string>
#include <tuple>

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

}  // namespace thermocomp
