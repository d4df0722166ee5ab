#include "simulator/files/fault_codes.hpp"

#include "drivers/modbus/register_codec.hpp"

namespace thermocomp {
namespace {

const Names<ModbusTable> table_names{{"coil", ModbusTable::coil},
                                     {"discrete_input", ModbusTable::discrete_input},
                                     {"holding", ModbusTable::holding},
                                     {"input", ModbusTable::input}};

}  // namespace

FaultCodes read_fault_codes(const TomlTable& table, std::int64_t low, std::int64_t high) {
  FaultCodes codes;
  for (const auto& [key, fault] : {std::pair{"open_circuit_codes", ChannelFault::open_circuit},
                                   {"short_circuit_codes", ChannelFault::short_circuit},
                                   {"over_range_codes", ChannelFault::over_range},
                                   {"under_range_codes", ChannelFault::under_range},
                                   {"error_codes", ChannelFault::error}}) {
    std::vector<std::int64_t> listed = table.integers(key, low, high, std::vector<std::int64_t>{});
    if (!listed.empty()) codes.emplace(fault, std::move(listed));
  }
  return codes;
}

SimulatedStatus read_simulated_status(const TomlTable& table) {
  SimulatedStatus status;
  status.table = table.choice("table", table_names, ModbusTable::discrete_input);
  status.address = table.integer<std::uint16_t>("address", 0, 65535);
  const bool bit = is_bit_table(status.table);
  if (!bit) status.mask = table.integer<std::uint16_t>("mask", 1, 0xFFFF, 0xFFFF);
  status.codes = read_fault_codes(table, 0, bit ? 1 : 0xFFFF);
  if (status.codes.empty()) status.codes[ChannelFault::open_circuit] = {1};
  const auto good = table.integers("good_codes", 0, bit ? 1 : 0xFFFF, std::vector<std::int64_t>{});
  if (!good.empty()) status.good = static_cast<std::uint16_t>(good.front());
  return status;
}

CanStatusCodes read_can_status_codes(const TomlTable& table) {
  CanStatusCodes status;
  status.codes = read_fault_codes(table, INT64_MIN, INT64_MAX);  // the place's reader has limits
  const auto good = table.integers("good_codes", INT64_MIN, INT64_MAX, std::vector<std::int64_t>{});
  if (!good.empty()) status.good = good.front();
  return status;
}

bool RegistersTaken::take(int unit, ModbusTable table, std::size_t address, std::size_t count,
                          std::uint16_t mask) {
  bool free = true;
  for (std::size_t i = 0; i < count; ++i) {
    std::uint16_t& taken = words_[{unit, static_cast<int>(table), address + i}];
    free = (taken & mask) == 0 && free;
    taken = static_cast<std::uint16_t>(taken | mask);
  }
  return free;
}

}  // namespace thermocomp
