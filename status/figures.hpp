/// Numbers, durations and times as text.
#pragma once

#include <string>
#include <vector>

namespace thermocomp {

/// `value` with `digits` decimals, "-" for NaN, padded to `width`.
[[nodiscard]] std::string fixed(double value, int digits, int width = 0);
/// The same, always with a sign.
[[nodiscard]] std::string fixed_signed(double value, int digits, int width = 0);
/// `text` padded on the right to `width` characters (UTF-8).
[[nodiscard]] std::string padded(const std::string& text, int width);
/// A duration: "7 s", "12 min 5 s", "3 h 20 min", "5 d 2 h"; "-" for NaN.
[[nodiscard]] std::string duration_text(double seconds);
/// Local time of a wall time (seconds since 1970), to 0.1 s; "-" for NaN.
[[nodiscard]] std::string local_time(double wall_s);
/// "a, b, c"
[[nodiscard]] std::string joined(const std::vector<std::string>& words);

}  // namespace thermocomp
