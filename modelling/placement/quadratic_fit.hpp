/// Curves along guideways as quadratics.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "modelling/placement/placement_problem.hpp"

namespace thermocomp::placement {

/// Least squares of a X^2 + b X + c; of lower degree where there are fewer than three points.
/// @return {a, b, c}
[[nodiscard]] std::array<double, 3> fit_quadratic(std::span<const double> at,
                                                  std::span<const double> values);

/// The coefficients of all curves, of each the highest order first; of a single output c alone.
[[nodiscard]] Numbers curve_coefficients(const std::vector<Curve>& curves, const Numbers& rows_um);

}  // namespace thermocomp::placement
