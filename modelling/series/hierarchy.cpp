#include "modelling/series/hierarchy.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace thermocomp::series {
namespace {

constexpr int steps_max = 300;
constexpr double change_min = 1e-4;  ///< relative change of S and m at convergence
/// A direction counts as determined if the rows have at least this share of the series' precision.
constexpr double determined_share = 0.05;

Eigen::MatrixXd root_of(const Eigen::MatrixXd& covariance) {
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success)
    throw std::runtime_error("covariance of the coefficients is not positive definite");
  return factor.matrixL();
}

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& covariance) {
  return covariance.llt().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
}

/// Integral of the squared remainder, expected over the coefficients' covariance.
double left_of(const Evidence& evidence, const Coefficients& b) {
  return evidence.yy - 2.0 * b.mean.dot(evidence.xy) + b.mean.dot(evidence.xx * b.mean) +
         (evidence.xx * b.covariance).trace();
}

/// Covariance of m: each machine measures m + N(0, S + its own error).
Eigen::MatrixXd covariance_of_mean(std::span<const Evidence> machines, const Population& now,
                                   const Assumed& assumed) {
  const Eigen::Index count = now.mean.size();
  const Eigen::MatrixXd root = root_of(now.covariance);
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(count, count);
  Eigen::MatrixXd precision = Eigen::MatrixXd::Zero(count, count);
  for (const Evidence& each : machines) {
    const Eigen::MatrixXd b = root.transpose() * each.xx * root / now.density();
    precision += one - inverse_of(one + b);  // B (1 + B)^-1
  }
  // In coordinates of the root: precision + L' D^-1 L.
  if (assumed.mean_sd.size() > 0)
    precision += root.transpose() * assumed.mean_sd.cwiseAbs2().cwiseInverse().asDiagonal() * root;
  else
    precision.diagonal().array() += 1e-9;
  return root * inverse_of(precision) * root.transpose();
}

}  // namespace

Coefficients posterior(const Evidence& evidence, double density, const Eigen::VectorXd& mean,
                       const Eigen::MatrixXd& covariance) {
  const Eigen::MatrixXd root = root_of(covariance);
  Eigen::MatrixXd inner = root.transpose() * evidence.xx * root / density;
  inner.diagonal().array() += 1.0;
  const Eigen::LLT<Eigen::MatrixXd> factor(inner);
  Coefficients result;
  result.mean =
      mean + root * factor.solve(root.transpose() * (evidence.xy - evidence.xx * mean) / density);
  const Eigen::MatrixXd half = factor.matrixL().solve(root.transpose());
  result.covariance = half.transpose() * half;
  return result;
}

double shrinkage(std::size_t machines, Eigen::Index columns) {
  const auto free = static_cast<double>(columns - 1);
  return free / (free + static_cast<double>(machines));
}

Population em_step(std::span<const Evidence> machines, const Population& now,
                   const Assumed& assumed) {
  const auto count = static_cast<double>(machines.size());
  const Eigen::Index columns = now.mean.size();
  std::vector<Coefficients> of_machine;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(columns);
  double left = 0.0;
  double time_s = 0.0;
  for (const Evidence& each : machines) {
    of_machine.push_back(posterior(each, now.density(), now.mean, now.covariance));
    sum += of_machine.back().mean;
    left += left_of(each, of_machine.back());
    time_s += each.time_s;
  }
  Population next = now;
  if (assumed.mean_sd.size() > 0) {
    // m = (n S^-1 + D^-1)^-1 S^-1 sum b = D (D + S/n)^-1 (mean of b)
    const Eigen::VectorXd variance = assumed.mean_sd.cwiseAbs2();
    Eigen::MatrixXd both = now.covariance / count;
    both.diagonal() += variance;
    next.mean = variance.asDiagonal() * both.llt().solve(sum / count);
  } else {
    next.mean = sum / count;
  }
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(columns, columns);
  for (const Coefficients& each : of_machine) {
    const Eigen::VectorXd off = each.mean - next.mean;
    scatter += each.covariance + off * off.transpose();
  }
  if (assumed.machines > 0) scatter.diagonal() += assumed.machines * assumed.scatter_sd.cwiseAbs2();
  scatter /= count + assumed.machines;
  const double reduce = shrinkage(machines.size(), columns);
  next.covariance = (1.0 - reduce) * scatter;
  next.covariance.diagonal() = scatter.diagonal();
  if (assumed.estimate_remainder)
    next.remainder_um = std::sqrt(std::max(left, 1e-12 * time_s) / time_s);
  return next;
}

Population population_of(std::span<const Evidence> machines, const Assumed& assumed,
                         double noise_time_s) {
  Population now;
  now.noise_time_s = noise_time_s;
  now.mean = Eigen::VectorXd::Zero(assumed.scatter_sd.size());
  now.covariance = assumed.scatter_sd.cwiseAbs2().asDiagonal();
  if (assumed.mean_sd.size() > 0)  // wide enough for all
    now.covariance += Eigen::MatrixXd(assumed.mean_sd.cwiseAbs2().asDiagonal());
  double yy = 0.0;
  double time_s = 0.0;
  for (const Evidence& each : machines) {
    yy += each.yy;
    time_s += each.time_s;
  }
  now.remainder_um = 0.3 * std::sqrt(std::max(yy / time_s, 1e-12));
  for (int step = 0; step < steps_max; ++step) {
    const Population next = em_step(machines, now, assumed);
    const double change = (next.covariance - now.covariance).norm() / now.covariance.norm() +
                          (next.mean - now.mean).norm() / (now.mean.norm() + 1e-300);
    now = next;
    if (!(change > change_min)) break;
  }
  now.mean_covariance = covariance_of_mean(machines, now, assumed);
  return now;
}

double f_tail(double f, double freedom, double freedom_below) {
  if (!(f > 0) || !(freedom > 0)) return 1.0;
  const double a = 2.0 / (9.0 * freedom);
  const double b = 2.0 / (9.0 * freedom_below);
  const double root = std::cbrt(f);
  const double z = ((1.0 - b) * root - (1.0 - a)) / std::sqrt(b * root * root + a);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

Departure departure_of(const Evidence& evidence, double density, const Eigen::VectorXd& mean,
                       const Eigen::MatrixXd& covariance, double machines,
                       std::span<const Group> groups) {
  const Eigen::MatrixXd root = root_of(covariance);
  // In units of the series' scatter the rows have precision B; their score has variance B + B^2.
  const Eigen::MatrixXd b = root.transpose() * evidence.xx * root / density;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(b);
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < b.rows(); ++i)
    if (eigen.eigenvalues()[i] > determined_share) kept.push_back(i);
  Departure departure;
  departure.freedom = static_cast<double>(kept.size());
  if (kept.empty()) return departure;
  const Eigen::ArrayXd value = eigen.eigenvalues()(kept);
  const Eigen::MatrixXd to_unit = (value + value.square()).rsqrt().matrix().asDiagonal() *
                                  eigen.eigenvectors()(Eigen::all, kept).transpose() *
                                  root.transpose() / density;
  const Eigen::VectorXd unit = to_unit * (evidence.xy - evidence.xx * mean);
  departure.distance2 = unit.squaredNorm();
  departure.probability =
      f_tail(departure.distance2 / departure.freedom, departure.freedom, machines);
  const Eigen::MatrixXd response = to_unit * evidence.xx;
  for (const Group& group : groups) {
    const Eigen::MatrixXd of_group = response(Eigen::all, group.columns);
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
    solver.setThreshold(1e-3);
    solver.compute(of_group);
    const Eigen::VectorXd step = solver.solve(unit);
    const double share = (of_group * step).squaredNorm() / std::max(departure.distance2, 1e-300);
    const double square =
        step.dot(evidence.xx(group.columns, group.columns) * step) / evidence.time_s;
    departure.parts.push_back({group.name, share, std::sqrt(std::max(square, 0.0))});
  }
  std::stable_sort(departure.parts.begin(), departure.parts.end(),
                   [](const auto& x, const auto& y) { return x.share > y.share; });
  return departure;
}

}  // namespace thermocomp::series
