#include "estimator/sensing/precision.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Cholesky>

#include "estimator/checks.hpp"

namespace thermocomp {

std::vector<double> precision_per_K2(const ThermalModel& model) {
  using Matrix = Eigen::MatrixXd;
  require(model.covariance_K2.size() == model.inputs.size(), "covariance.matrix_K2",
          static_cast<double>(model.covariance_K2.size()), "must have one row an input");
  require(model.inputs.size() <= covariance_inputs_max, "covariance.matrix_K2",
          static_cast<double>(model.inputs.size()), "has more inputs than can be estimated");
  model.covariance_growth.validate(model.inputs.size());
  const double noise_K = model.covariance_growth.noise_K;
  const auto n = static_cast<Eigen::Index>(model.inputs.size());
  Matrix covariance_K2(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      covariance_K2(i, j) =
          model.covariance_K2[static_cast<std::size_t>(i)].at(static_cast<std::size_t>(j));
  // The file's matrix may be negative by what rounding does to large numbers.
  const double rounding_K2 = 1e-8 * static_cast<double>(n) * covariance_K2.cwiseAbs().maxCoeff();
  covariance_K2.diagonal().array() += std::max(noise_K * noise_K, rounding_K2);
  const Eigen::LLT<Matrix> llt(covariance_K2);
  if (llt.info() != Eigen::Success)
    throw InvalidValue("covariance.matrix_K2", std::to_string(n) + " rows",
                       "must be positive semidefinite");
  const Matrix inverse = llt.solve(Matrix::Identity(n, n));
  std::vector<double> flat;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) flat.push_back(0.5 * (inverse(i, j) + inverse(j, i)));
  return flat;
}

double grown(double age_s, double time_s) noexcept {
  if (!(time_s > 0)) return age_s > 0 ? 1.0 : 0.0;
  return -std::expm1(-age_s / time_s);
}

double drift_factor(const CovarianceGrowth& growth, std::size_t input) noexcept {
  return growth.drift_factor.empty() ? drift_factor_default : growth.drift_factor[input];
}

double scatter_factor(const CovarianceGrowth& growth, std::size_t input) noexcept {
  return growth.scatter_factor.empty() ? 0.0 : growth.scatter_factor[input];
}

}  // namespace thermocomp
