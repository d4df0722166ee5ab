/// Foreign text made printable, and numbers as text that parses to the same value.
#pragma once

#include <string>
#include <string_view>

namespace thermocomp {

[[nodiscard]] constexpr bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// UTF-8's mark, which programs of Windows write at the start of a text.
inline constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";

/// False if the text has control characters (C0, DEL, C1), Unicode's directional marks, embeddings,
/// overrides and isolates, line and paragraph separators, zero-width characters except joiners, or
/// invalid UTF-8.
[[nodiscard]] bool is_printable(std::string_view text);
inline constexpr std::string_view printable_rule =
    "must be printable, without control characters or changes of writing direction";

/// Replaces unprintable characters by their name: `<U+202E>`; a byte that is not UTF-8 by `?`, a C0
/// control character or DEL by a blank.
[[nodiscard]] std::string printable_text(std::string_view text);

/// Appends the shortest decimal text that parses to `value`; NaN becomes "nan".
void append_number(std::string& text, double value);
[[nodiscard]] std::string number_text(double value);

}  // namespace thermocomp
