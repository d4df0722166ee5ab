/// Numbers, durations and times as people read them.
#pragma once

#include <string>
#include <vector>

namespace thermocomp {

/// `value` with so many digits after the point, "-" for NaN, in a field of at least `width`.
[[nodiscard]] std::string fixed(double value, int digits, int width = 0);
/// The same with its sign always shown.
[[nodiscard]] std::string fixed_signed(double value, int digits, int width = 0);
/// `text` with blanks to its right (left-aligned) up to `width` characters (UTF-8).
[[nodiscard]] std::string padded(const std::string& text, int width);
/// A duration for people: "7 s", "12 min 5 s", "3 h 20 min", "5 d 2 h"; "-" for NaN.
[[nodiscard]] std::string duration_text(double seconds);
/// A wall time (seconds since 1970) as the clock here shows it, with a tenth; "-" for NaN.
[[nodiscard]] std::string local_time(double wall_s);
/// "a, b, c"
[[nodiscard]] std::string joined(const std::vector<std::string>& words);

}  // namespace thermocomp
