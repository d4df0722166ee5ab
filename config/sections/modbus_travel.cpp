#include "config/sections/modbus_travel.hpp"

#include <cmath>
#include <optional>

#include "config/sections/modbus_values.hpp"
#include "config/sections/travel_section.hpp"

namespace thermocomp::sections {
namespace {

Carried carried(const ModbusValue& value) {
  return {reach(value), count_of(value)};
}

struct TravelReader {
  const TravelSection section;
  WrittenRegisters& written;
  ModbusTravel travel{section.shape(), {}, {}, {}, {}};

  /// begin, values and end are one block; `next` is where it goes on.
  ModbusValue read_in_block(const TomlTable& own, std::string_view key, RegisterUse use,
                            std::optional<int>& next) {
    const TomlTable place = own.table(key);
    const ModbusValue value = read_modbus_value(place, use);
    if (!place) {
      next.reset();
      return value;
    }
    written.add(own, key, value);
    if (next && *next != value.address)
      own.problem(key, "must begin at register " + std::to_string(*next) +
                           ": the registers of a set follow one another, from `begin` to `end`");
    next = value.address + static_cast<int>(registers_of(value.encoding));
    return value;
  }

  void read_line() {
    const TomlTable& table = section.table();
    std::optional<int> next;
    travel.begin = read_in_block(table, "begin", RegisterUse::written_bits, next);
    const ModbusValue k0 = read_in_block(table, "k0_um", RegisterUse::written, next);
    const ModbusValue slope = read_in_block(table, "slope_um_per_m", RegisterUse::written, next);
    travel.values = {k0, slope};
    if (table.has("p0_register_mm"))
      travel.values.push_back(read_in_block(table, "p0_register_mm", RegisterUse::written, next));
    check_line(table, travel.values);
    travel.end = read_in_block(table, "end", RegisterUse::written_bits, next);
    const TomlTable applied = table.table_or_empty("applied");
    if (!applied) return;
    const auto shown = [&](std::string_view key) {
      return read_modbus_value(applied.table(key), RegisterUse::number);
    };
    travel.applied = {shown("k0_um"), shown("slope_um_per_m")};
    if (applied.has("p0_register_mm")) travel.applied.push_back(shown("p0_register_mm"));
    check_line(applied, travel.applied);
  }

  void check_line(const TomlTable& own, const std::vector<ModbusValue>& values) const {
    if (own.has("k0_um")) section.check_offset(own, "k0_um", carried(values[0]));
    if (own.has("slope_um_per_m")) section.check_slope(own, "slope_um_per_m", carried(values[1]));
    if (values.size() > 2) section.check_p0(own, "p0_register_mm", carried(values[2]));
  }

  /// One after the other from where the first one stands.
  static std::vector<ModbusValue> row_from(const ModbusValue& first, std::size_t count) {
    std::vector<ModbusValue> row(count, first);
    for (std::size_t i = 0; i < count; ++i)
      row[i].address = static_cast<std::uint16_t>(first.address + i * registers_of(first.encoding));
    return row;
  }

  static bool fits(const TomlTable& own, std::string_view key, const ModbusValue& first,
                   std::size_t count) {
    if (first.address + count * registers_of(first.encoding) <= 65536) return true;
    own.problem(key, "the offsets of all nodes would pass register 65535");
    return false;
  }

  void read_table() {
    const TomlTable& table = section.table();
    const std::size_t count = travel.nodes_mm.size();
    std::optional<int> next;
    travel.begin = read_in_block(table, "begin", RegisterUse::written_bits, next);
    const ModbusValue first = read_in_block(table, "offsets", RegisterUse::written, next);
    if (table.has("offsets")) section.check_offset(table, "offsets", carried(first));
    if (!fits(table, "offsets", first, count)) return;
    travel.values = row_from(first, count);
    for (std::size_t i = 1; i < count; ++i) written.add(table, "offsets", travel.values[i]);
    if (next) next = travel.values.back().address + static_cast<int>(registers_of(first.encoding));
    travel.end = read_in_block(table, "end", RegisterUse::written_bits, next);
    const TomlTable applied = table.table_or_empty("applied");
    if (!applied) return;
    const ModbusValue shown = read_modbus_value(applied, RegisterUse::number);
    section.check_offset(table, "applied", carried(shown));
    if (fits(table, "applied", shown, count)) travel.applied = row_from(shown, count);
  }
};

}  // namespace

void WrittenRegisters::add(const TomlTable& table, std::string_view key, const ModbusValue& value) {
  const bool is_s7 = value.table == ModbusTable::data_block;
  for (int i = 0; i < static_cast<int>(words_of(value.table, value.encoding)); ++i) {
    const auto [entry, is_new] = used_.emplace(value.address + i, table.path());
    if (is_new) continue;
    const int place = is_s7 ? 2 * entry->first : entry->first;
    table.problem(key, (is_s7 ? "byte " : "register ") + std::to_string(place) + " is written by " +
                           entry->second + " already");
    return;
  }
}

ModbusTravel read_modbus_travel(const TomlTable& axis, const LimiterConfig& limiter,
                                WrittenRegisters& written) {
  TravelReader reader{TravelSection(axis, limiter), written};
  reader.section.table().refuse("set_numbers",
                                "makes no sense in registers: `begin` and `end` hold the number");
  reader.section.is_line() ? reader.read_line() : reader.read_table();
  const ModbusTravel& travel = reader.travel;
  if (travel.begin.encoding != travel.end.encoding)
    reader.section.table().problem(
        "end", "must have the encoding of `begin`: both hold the number of the set");
  return reader.travel;
}

}  // namespace thermocomp::sections
