#include "modelling/placement/quadratic_fit.hpp"

#include <algorithm>

#include <Eigen/QR>

namespace thermocomp::placement {

std::array<double, 3> fit_quadratic(std::span<const double> at, std::span<const double> values) {
  const auto points = static_cast<Eigen::Index>(at.size());
  const Eigen::Index terms = std::min<Eigen::Index>(points, 3);
  Eigen::MatrixXd powers(points, terms);  // 1, X, X^2
  Eigen::VectorXd wanted(points);
  for (Eigen::Index i = 0; i < points; ++i) {
    double power = 1.0;
    for (Eigen::Index j = 0; j < terms; ++j) {
      powers(i, j) = power;
      power *= at[static_cast<std::size_t>(i)];
    }
    wanted[i] = values[static_cast<std::size_t>(i)];
  }
  const Eigen::VectorXd fitted = powers.colPivHouseholderQr().solve(wanted);
  std::array<double, 3> result{};
  for (Eigen::Index j = 0; j < terms; ++j) result[2 - static_cast<std::size_t>(j)] = fitted[j];
  return result;
}

Numbers curve_coefficients(const std::vector<Curve>& curves, const Numbers& rows_um) {
  Numbers coefficients;
  for (const Curve& curve : curves) {
    if (curve.at.size() == 1) {
      coefficients.push_back(rows_um[curve.first_row]);
      continue;
    }
    const auto fit = fit_quadratic(curve.at, {&rows_um[curve.first_row], curve.at.size()});
    coefficients.insert(coefficients.end(), fit.begin(), fit.end());
  }
  return coefficients;
}

}  // namespace thermocomp::placement
