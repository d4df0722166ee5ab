/// What an axis of a machine tool is called.
#pragma once

#include <string_view>

namespace thermocomp {

/// "x", "Z", "c": one letter of a linear or a rotary axis.
[[nodiscard]] constexpr bool is_axis_letter(std::string_view name) noexcept {
  constexpr std::string_view letters = "xyzabcXYZABC";
  return name.size() == 1 && letters.find(name.front()) != std::string_view::npos;
}

}  // namespace thermocomp
