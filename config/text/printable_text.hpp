/// What somebody else wrote as text that can be shown, and numbers as text that reads back.
#pragma once

#include <string>
#include <string_view>

namespace thermocomp {

/// No control character (C0, DEL, C1), none of Unicode's marks, embeddings, overrides and isolates
/// of direction, no line or paragraph separator, no invisible character without width that joins
/// nothing, no byte that is not UTF-8.
[[nodiscard]] bool is_printable(std::string_view text);
inline constexpr std::string_view printable_rule =
    "must be printable: no control characters, none that turn the direction of writing";

/// The same text with what is not printable named: `<U+202E>`; a byte that is not UTF-8 as `?`, a
/// C0 control character or DEL as a blank.
[[nodiscard]] std::string printable_text(std::string_view text);

/// Appends the shortest decimal text of `value`; NaN becomes "nan".
void append_number(std::string& text, double value);
[[nodiscard]] std::string number_text(double value);

}  // namespace thermocomp
