/// What in a field may be a number, and the unit behind it.
#pragma once

#include <string_view>

namespace thermocomp {

struct SpelledUnit;

/// A number with its unit behind it, "22.1 °C"; without one, `unit` is nullptr.
struct NumberText {
  std::string_view digits;  ///< the number
  const SpelledUnit* unit{nullptr};
};
[[nodiscard]] NumberText number_text_of(std::string_view field);

/// Whether it may be a number of one form or the other, with or without a unit.
[[nodiscard]] bool looks_like_number(std::string_view field);

/// Digits in front and, where there is none behind, three digits after each `sign`.
[[nodiscard]] bool is_grouped(std::string_view text, char sign);

}  // namespace thermocomp
