/// Common parts of the sections of the daemon's file.
#pragma once

#include <initializer_list>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/toml/toml_reader.hpp"
#include "drivers/bus.hpp"
#include "estimator/checks.hpp"

namespace thermocomp::sections {

/// Refuses each of `keys` that is present.
inline void refuse_all(const TomlTable& table, std::initializer_list<std::string_view> keys,
                       std::string_view rule) {
  for (const std::string_view key : keys) table.refuse(key, rule);
}

/// Reads `name`; one used before (in `seen`) is a problem.
inline std::string unique_name(const TomlTable& table, std::set<std::string>& seen) {
  std::string name = table.text("name");
  if (!name.empty() && !seen.insert(name).second) table.problem("name", "is used twice");
  return name;
}

/// "x, y, z"
[[nodiscard]] inline std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text.append(text.empty() ? "" : ", ").append(name);
  return text.empty() ? "there is none" : text;
}

/// A scale: any finite number but 0.
[[nodiscard]] inline double read_scale(const TomlTable& table, double otherwise) {
  const double scale = table.number("scale", Range::any(), otherwise);
  if (scale != 0.0) return scale;
  table.problem("scale", "must not be 0");
  return 1.0;
}

/// The codes within `[low, high]` (of a signed number also as bit pattern) that are messages
/// instead of values, from the lists open_circuit_codes, short_circuit_codes, over_range_codes,
/// under_range_codes and error_codes; a list in `own` replaces that of `base`.
[[nodiscard]] std::vector<Sentinel> read_codes(const TomlTable& own, const TomlTable& base,
                                               std::int64_t low, std::int64_t high);

/// The codes of a status: the same lists, and good_codes (Fault::none; default 0). A code with bits
/// outside `mask` is a problem.
[[nodiscard]] std::vector<Sentinel> read_status_codes(const TomlTable& table, std::int64_t high,
                                                      std::int64_t mask);

/// Reads Config::numbers(), missing ones from `fallback`, and calls Config::validate(): every
/// refused number becomes a problem at its key and is reset to `fallback`, until the rest is valid.
/// @pre fallback.validate() passes
template <class Config>
void read_numbers(const TomlTable& table, const Config& fallback, Config& config) {
  constexpr auto numbers = Config::numbers();
  for (const auto& number : numbers) {
    if (number.whole_member != nullptr)
      config.*number.whole_member = table.integer<std::uint64_t>(
          number.key, static_cast<std::uint64_t>(number.min),
          static_cast<std::uint64_t>(number.max), fallback.*number.whole_member);
    else
      config.*number.member = table.number(number.key, Range::any(), fallback.*number.member);
  }
  for (std::size_t attempt = 0; attempt <= numbers.size(); ++attempt) {
    try {
      config.validate();
      return;
    } catch (const InvalidValue& error) {
      if (table.has(error.key())) {
        table.problem(error.key(), error.rule());
      } else {
        table.problem(error.key(), error.value(), error.rule());
      }
      bool reset = false;
      for (const auto& number : numbers) {
        if (number.key != error.key() || number.of(config) == number.of(fallback)) continue;
        number.copy(fallback, config);
        reset = true;
      }
      if (!reset) break;  // only a fallback is left: the cause cannot be isolated
    }
  }
  for (const auto& number : numbers) number.copy(fallback, config);
}

}  // namespace thermocomp::sections
