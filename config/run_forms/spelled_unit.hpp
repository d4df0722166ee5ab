/// Units in other spellings; numbers with a unit, with a decimal point or comma.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace thermocomp {

/// A unit in one spelling. A number becomes `factor * number + offset` in the base unit of its
/// dimension (degC, um, urad, s, ...).
struct SpelledUnit {
  std::string_view spelling;   ///< "°F"
  std::string_view dimension;  ///< "temperature"
  double factor{1.0};
  double offset{0.0};
  std::string_view suffix;       ///< nearest suffix of ours, "_degC"; empty: a signal without unit
  bool only_in_brackets{false};  ///< too short to be recognised elsewhere

  /// Whether it is the same unit, in any spelling.
  [[nodiscard]] bool measures_as(const SpelledUnit& other) const {
    return dimension == other.dimension && factor == other.factor && offset == other.offset;
  }
};

/// Parts of a header's name.
struct SpelledName {
  std::string base;  ///< "T1"
  std::string unit;  ///< "°C" as written; empty: none
  /// nullptr: no unit, or brackets with other content
  const SpelledUnit* known{nullptr};
};
[[nodiscard]] SpelledName spelled_name(std::string_view header);

/// Accepts temperatures with any form of the degree sign or in words ("ºC", "Deg. C").
/// @return nullptr when it is not a unit
[[nodiscard]] const SpelledUnit* spelled_unit(std::string_view unit);
/// @return nullptr when it is not a unit of time
[[nodiscard]] const SpelledUnit* time_unit(std::string_view unit);

/// Whether text in brackets has a degree or percent sign, or a word that is a unit in some case:
/// "0.1 °C", "1/10 MM"; not "bed 1".
[[nodiscard]] bool may_be_unit(std::string_view text);

/// A unit, or a multiple of one: "0.1 degC".
[[nodiscard]] std::optional<SpelledUnit> unit_with_factor(std::string_view unit);

/// our value = factor * given value + offset.
struct UnitConversion {
  double factor{1.0};
  double offset{0.0};
  [[nodiscard]] bool is_identity() const { return factor == 1.0 && offset == 0.0; }
};
/// Conversion from a unit to that of one of our column names.
/// @return nullopt if the dimensions differ
[[nodiscard]] std::optional<UnitConversion> conversion(const SpelledUnit& from,
                                                       std::string_view column);

/// `base` as a column name of ours: blanks, commas, quotes and bars become `_`.
[[nodiscard]] std::string plain_name(std::string_view base);

/// The name of a column of ours without its unit: "T1" of "T1_degC".
[[nodiscard]] std::string without_unit(std::string_view column);
/// The name or, if it is taken, the first of T1_2_degC, T1_3_degC, ... that is not.
[[nodiscard]] std::string unused_name(const std::string& column,
                                      const std::function<bool(const std::string&)>& is_taken);

/// A number with its unit, "22.1 °C"; `unit` is nullptr without one.
struct NumberText {
  std::string_view digits;  ///< the number
  const SpelledUnit* unit{nullptr};
};
[[nodiscard]] NumberText number_text_of(std::string_view field);

struct NumberForm {
  char decimal{'.'};
  char thousands{'\0'};  ///< none
};

/// @return nullopt unless `field` is one finite number of that form
[[nodiscard]] std::optional<double> number_of(std::string_view field, const NumberForm& form);

/// Whether it may be a number of either form, with or without unit.
[[nodiscard]] bool looks_like_number(std::string_view field);

/// Digits, then groups of three digits, each after `sign`, up to the end.
[[nodiscard]] bool is_grouped_by_blanks(std::string_view field);
[[nodiscard]] bool is_grouped(std::string_view text, char sign);

}  // namespace thermocomp
