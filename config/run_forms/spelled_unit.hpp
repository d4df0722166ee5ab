/// Units as others spell them, and the number in front of one.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace thermocomp {

/// A unit as somebody spells it. A number of it becomes `factor * number + offset` in the base unit
/// of its dimension (degC, um, urad, s, ...).
struct SpelledUnit {
  std::string_view spelling;   ///< "°F"
  std::string_view dimension;  ///< "temperature"
  double factor{1.0};
  double offset{0.0};
  std::string_view suffix;       ///< the nearest of ours, "_degC"; empty: a signal without unit
  bool only_in_brackets{false};  ///< too short to be taken for a unit elsewhere
};

/// A header's name in its parts.
struct SpelledName {
  std::string base;  ///< "T1"
  std::string unit;  ///< "°C" as written; empty: there is none
  /// nullptr: the name has no unit, or brackets around something that is none
  const SpelledUnit* known{nullptr};
};
[[nodiscard]] SpelledName spelled_name(std::string_view header);

/// Temperatures also with the degree sign in any of its disguises or in words ("ºC", "Deg. C").
/// @return nullptr when it is none
[[nodiscard]] const SpelledUnit* spelled_unit(std::string_view unit);

/// ours = factor * theirs + offset.
struct UnitConversion {
  double factor{1.0};
  double offset{0.0};
  [[nodiscard]] bool is_identity() const { return factor == 1.0 && offset == 0.0; }
};
/// From a spelled unit to the unit of one of our column names.
/// @return nullopt when they are of different dimensions
[[nodiscard]] std::optional<UnitConversion> conversion(const SpelledUnit& from,
                                                       std::string_view column);

/// `base` as one of our column names: blanks, commas, quotes and bars as `_`.
[[nodiscard]] std::string plain_name(std::string_view base);

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
