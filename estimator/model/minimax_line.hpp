/// The straight line that is nearest to a curve.
#pragma once

#include <span>

namespace thermocomp {

/// y = at_first + (at_last - at_first) (x - x_first) / (x_last - x_first)
struct CurveLine {
  double at_first{0.0};   ///< value at the first point
  double at_last{0.0};    ///< value at the last point
  double deviation{0.0};  ///< largest |y_i - line(x_i)|
};

/// The line whose largest deviation from the points is the least possible: it passes between three
/// of them at equal distances, on alternating sides, and no other point lies further off.
/// @param x  strictly increasing, two points at least
/// @param y  shape (x)
/// Never throws, never allocates. A value that is no number gives a line that is none.
/// Source: E. Ya. Remez, exchange algorithm for a polynomial of the first degree on a finite set.
[[nodiscard]] CurveLine minimax_line(std::span<const double> x, std::span<const double> y) noexcept;

}  // namespace thermocomp
