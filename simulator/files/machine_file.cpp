#include "simulator/files/machine_file.hpp"

#include <algorithm>

#include "drivers/modbus/modbus_codec.hpp"
#include "simulator/files/machine_file_parts.hpp"

namespace thermocomp {
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
  status.codes = read_fault_codes(table, INT64_MIN, INT64_MAX);  // checked by the place's reader
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
  presets.ignore_rest();  // simulated devices do not use every key
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
