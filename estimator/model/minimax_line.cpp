#include "estimator/model/minimax_line.hpp"

#include <array>
#include <cmath>
#include <cstddef>

#include "estimator/checks.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

/// Three points in order, and the line that has them at equal distances on alternating sides.
struct Levelled {
  std::array<std::size_t, 3> at{};
  double base{0.0};  ///< at the first point of the curve
  double slope{0.0};
  double level{0.0};  ///< of the middle one above the line; the outer ones are below by as much

  Levelled(std::span<const double> x, std::span<const double> y,
           const std::array<std::size_t, 3>& points)
      : at(points) {
    const auto [a, b, c] = points;
    slope = (y[c] - y[a]) / (x[c] - x[a]);
    level = (y[b] - (y[a] + slope * (x[b] - x[a]))) / 2.0;
    base = y[a] + level - slope * (x[a] - x[0]);
  }

  [[nodiscard]] double above(std::span<const double> x, std::span<const double> y,
                             std::size_t i) const noexcept {
    return y[i] - (base + slope * (x[i] - x[0]));
  }
};

/// The point takes the place of the one beside it that lies on the same side of the line.
std::array<std::size_t, 3> exchanged(const Levelled& line, std::size_t point, double above) {
  const auto [a, b, c] = line.at;
  const bool like_middle = std::signbit(above) == std::signbit(line.level);
  if (point < a) return like_middle ? std::array{point, a, b} : std::array{point, b, c};
  if (point < b) return like_middle ? std::array{a, point, c} : std::array{point, b, c};
  if (point < c) return like_middle ? std::array{a, point, c} : std::array{a, b, point};
  return like_middle ? std::array{b, c, point} : std::array{a, b, point};
}

}  // namespace

CurveLine minimax_line(std::span<const double> x, std::span<const double> y) noexcept {
  THERMOCOMP_ENSURE(x.size() >= 2 && y.size() == x.size());
  const std::size_t last = x.size() - 1;
  for (const double value : y)
    if (!std::isfinite(value)) return {not_a_number, not_a_number, not_a_number};
  if (last == 1) return {y[0], y[1], 0.0};
  // Each exchange raises the level; the count is a bound for values that are no numbers.
  const std::size_t exchanges_max = 4 * x.size();
  std::array<std::size_t, 3> points{0, last / 2, last};
  for (std::size_t exchanges = 0;; ++exchanges) {
    const Levelled line(x, y, points);
    std::size_t worst = points[1];
    for (std::size_t i = 0; i <= last; ++i)
      if (std::abs(line.above(x, y, i)) > std::abs(line.above(x, y, worst))) worst = i;
    const double deviation = std::abs(line.above(x, y, worst));
    const double rounding = 1e-12 * (std::abs(line.base) + std::abs(line.slope * (x[last] - x[0])));
    const bool is_best = !(deviation > std::abs(line.level) + rounding);
    if (is_best || exchanges == exchanges_max)
      return {line.base, line.base + line.slope * (x[last] - x[0]), deviation};
    points = exchanged(line, worst, line.above(x, y, worst));
  }
}

}  // namespace thermocomp
