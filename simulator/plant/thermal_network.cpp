#include "simulator/plant/thermal_network.hpp"

#include <cmath>

#include <Eigen/Dense>

#include "estimator/checks.hpp"

namespace thermocomp {

struct ThermalNetwork::Modes {
  Eigen::VectorXd root_capacity;  ///< sqrt(C)
  Eigen::VectorXd rate_per_s;     ///< eigenvalues of C^-1/2 K C^-1/2
  Eigen::MatrixXd shapes;         ///< its eigenvectors, by column
};

ThermalNetwork::ThermalNetwork(std::span<const double> capacity_J_per_K,
                               std::span<const double> conductance_W_per_K)
    : modes_(std::make_unique<Modes>()) {
  const auto n = static_cast<Eigen::Index>(capacity_J_per_K.size());
  THERMOCOMP_ENSURE(n > 0);
  THERMOCOMP_ENSURE(conductance_W_per_K.size() ==
                    capacity_J_per_K.size() * capacity_J_per_K.size());
  const Eigen::Map<const Eigen::VectorXd> capacity(capacity_J_per_K.data(), n);
  const Eigen::Map<const Eigen::MatrixXd> conductance(conductance_W_per_K.data(), n, n);
  modes_->root_capacity = capacity.cwiseSqrt();
  const Eigen::VectorXd inverse_root = modes_->root_capacity.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      inverse_root.asDiagonal() * conductance * inverse_root.asDiagonal());
  THERMOCOMP_ENSURE(solver.info() == Eigen::Success);
  modes_->rate_per_s = solver.eigenvalues().cwiseMax(0.0);
  modes_->shapes = solver.eigenvectors();
}

ThermalNetwork::~ThermalNetwork() = default;
ThermalNetwork::ThermalNetwork(ThermalNetwork&&) noexcept = default;
ThermalNetwork& ThermalNetwork::operator=(ThermalNetwork&&) noexcept = default;

void ThermalNetwork::advance(double dt_s, std::span<const double> heat_W,
                             std::span<double> temps_degC) const {
  const Eigen::Index n = modes_->rate_per_s.size();
  THERMOCOMP_ENSURE(static_cast<Eigen::Index>(heat_W.size()) == n);
  THERMOCOMP_ENSURE(static_cast<Eigen::Index>(temps_degC.size()) == n);
  const Eigen::Map<const Eigen::VectorXd> heat(heat_W.data(), n);
  Eigen::Map<Eigen::VectorXd> temps(temps_degC.data(), n);
  Eigen::VectorXd mode = modes_->shapes.transpose() * modes_->root_capacity.cwiseProduct(temps);
  const Eigen::VectorXd drive =
      modes_->shapes.transpose() * heat.cwiseQuotient(modes_->root_capacity);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double x = modes_->rate_per_s[i] * dt_s;
    // (1 - exp(-x)) / rate tends to dt as the rate tends to 0 (a body without losses).
    const double gain = x > 1e-12 ? -std::expm1(-x) / modes_->rate_per_s[i] : dt_s;
    mode[i] = std::exp(-x) * mode[i] + gain * drive[i];
  }
  temps = (modes_->shapes * mode).cwiseQuotient(modes_->root_capacity);
}

}  // namespace thermocomp
