/// The text of one field of a run file.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace thermocomp {

/// Removes blanks and tabs at both ends.
[[nodiscard]] std::string_view trimmed(std::string_view text);

/// Empty, nan, NaN or NAN: a missing value in our own form.
[[nodiscard]] bool is_missing(std::string_view field);

/// @return nullopt unless `field` is one finite decimal number
[[nodiscard]] std::optional<double> finite_number(std::string_view field);

/// Splits the part before the next separator off `rest`. @return false at the end
[[nodiscard]] bool take(std::string_view& rest, char separator, std::string_view& part);

/// Takes the first line off `text`; returned without its line end.
[[nodiscard]] std::string_view take_line(std::string_view& text);

/// ASCII letters only.
[[nodiscard]] std::string small_letters(std::string_view text);

/// Ignores the case of `text`.
/// @param words  in small letters, with bars around: "|date|time|"
[[nodiscard]] bool is_one_of(std::string_view words, std::string_view text);

/// The number of on and off, true and false.
[[nodiscard]] std::optional<double> switch_word(std::string_view field);

/// At most 40 bytes, cut between characters; " ..." marks an omission.
[[nodiscard]] std::string shortened(std::string_view text);

/// As a quoted TOML string.
[[nodiscard]] std::string toml_text(std::string_view text);

}  // namespace thermocomp
