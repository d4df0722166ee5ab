#include "config/sections/common.hpp"

#include <array>
#include <map>
#include <utility>

namespace thermocomp::sections {

std::vector<Sentinel> read_codes(const TomlTable& own, const TomlTable& base, std::int64_t low,
                                 std::int64_t high) {
  constexpr std::array<std::pair<std::string_view, Fault>, 5> lists{{
      {"open_circuit_codes", Fault::open_circuit},
      {"short_circuit_codes", Fault::short_circuit},
      {"over_range_codes", Fault::out_of_range},
      {"under_range_codes", Fault::out_of_range},
      {"error_codes", Fault::device_error},
  }};
  // Manuals also give the bit pattern of a signed number: 0x8000 for -32768.
  const bool is_signed = low == -high - 1 && high <= 0x7FFFFFFF;
  const std::int64_t greatest = is_signed ? 2 * high + 1 : high;
  std::vector<Sentinel> sentinels;
  std::map<std::int64_t, std::string_view> listed;
  for (const auto& [key, fault] : lists) {
    const bool in_base = base.has(key);
    const TomlTable& source = !own.has(key) && in_base ? base : own;
    for (const std::int64_t bits : source.integers(key, low, greatest, {})) {
      const std::int64_t code = bits > high ? bits + 2 * low : bits;
      const auto [entry, is_new] = listed.emplace(code, key);
      if (is_new) {
        sentinels.push_back({code, fault});
      } else {
        source.problem(key, std::to_string(code),
                       "must not be listed twice (also in " + std::string(entry->second) + ")");
      }
    }
  }
  return sentinels;
}

std::vector<Sentinel> read_status_codes(const TomlTable& table, std::int64_t high,
                                        std::int64_t mask) {
  std::vector<Sentinel> codes = read_codes(table, table, 0, high);
  const std::size_t faults = codes.size();
  for (const std::int64_t good : table.integers("good_codes", 0, high, {})) {
    for (std::size_t i = 0; i < faults; ++i) {
      if (codes[i].code != good) continue;
      table.problem("good_codes", std::to_string(good), "must not also be the code of a fault");
    }
    codes.push_back({good, Fault::none});
  }
  for (const Sentinel& code : codes) {
    if ((code.code & ~mask) == 0) continue;
    table.problem("mask", "hides bits of the code " + std::to_string(code.code));
  }
  return codes;
}

}  // namespace thermocomp::sections
