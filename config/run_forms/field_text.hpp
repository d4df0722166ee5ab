/// The text of one field of a run file.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace thermocomp {

/// Without blanks and tabs at the ends.
[[nodiscard]] std::string_view trimmed(std::string_view text);

/// Empty, nan, NaN or NAN: what our own form writes for a missing value.
[[nodiscard]] bool is_missing(std::string_view field);

/// @return nullopt unless all of `field` is one finite decimal number
[[nodiscard]] std::optional<double> finite_number(std::string_view field);

/// Takes the part before the next separator off `rest`. @return false when nothing is left
[[nodiscard]] bool take(std::string_view& rest, char separator, std::string_view& part);

/// At most 40 bytes of it, not cut within a letter; " ..." stands for what is left out.
[[nodiscard]] std::string shortened(std::string_view text);

/// As a string of TOML, in quotes.
[[nodiscard]] std::string toml_text(std::string_view text);

}  // namespace thermocomp
