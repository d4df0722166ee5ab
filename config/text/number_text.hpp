/// Numbers as text that reads back to the same bits.
#pragma once

#include <string>

namespace thermocomp {

/// Appends the shortest decimal text of `value`; NaN becomes "nan".
void append_number(std::string& text, double value);
[[nodiscard]] std::string number_text(double value);

}  // namespace thermocomp
