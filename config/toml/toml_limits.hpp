/// Limits of a TOML text, checked before it is parsed: the parser recurses into nested tables and
/// lists, and its result takes thirty times the text's size.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace thermocomp {

/// Tables and lists within each other: `[a.b]` has 2, `c = [[1]]` under it 4.
inline constexpr std::size_t toml_depth_max = 16;
/// Keys and headers of a file.
inline constexpr std::size_t toml_keys_max = 50'000;
/// Elements of all its lists.
inline constexpr std::size_t toml_elements_max = 1'000'000;

struct TomlExcess {
  int line{1};
  std::string rule;
};
/// The first place that breaks a limit; nullopt: there is none. A text that is not TOML is checked
/// up to where it stops being TOML. Does not recurse, O(size).
[[nodiscard]] std::optional<TomlExcess> toml_excess(std::string_view text);

}  // namespace thermocomp
