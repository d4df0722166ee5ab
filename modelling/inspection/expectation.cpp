#include "modelling/inspection/expectation.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "config/runs/robust.hpp"

namespace thermocomp::inspection {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int rounds = 3;           // rho converges to two digits on all shared data sets
constexpr double rho_max = 0.999;   // above it a remainder is effectively a random walk
constexpr Index batches = 12;       // of a run's remainder; 12 give its slow variance to +-40 %
constexpr double wild_share = 0.3;  // with it, one step of 2 K in 1000 rows adds 0.02 K
constexpr double offset_prior_share = 1e-8;  // offsets per run are practically free

}  // namespace

double spread(const Eigen::Ref<const Eigen::VectorXd>& values) {
  if (values.size() < 2) return 0.0;
  const double mean = values.mean();
  return std::sqrt((values.array() - mean).square().sum() / static_cast<double>(values.size() - 1));
}

Expectation::Expectation(const VectorXd& y, const MatrixXd& x, const VectorXd& prior,
                         const std::vector<Index>& begins)
    : begins_(begins) {
  sigma_ = std::max(0.1 * spread(y), 1e-9);
  for (int round = 0; round < rounds; ++round) {
    solve(y, x, prior);
    if (round + 1 < rounds) estimate_rho();
  }
}

MatrixXd Expectation::whitened(const MatrixXd& columns) const {
  MatrixXd white = columns;
  const double first = std::sqrt(1.0 - rho_ * rho_);
  for (std::size_t r = 0; r + 1 < begins_.size(); ++r) {
    const Index begin = begins_[r];
    const Index rows = begins_[r + 1] - begin;
    if (rows == 0) continue;
    white.row(begin) = first * columns.row(begin);
    white.middleRows(begin + 1, rows - 1) =
        columns.middleRows(begin + 1, rows - 1) - rho_ * columns.middleRows(begin, rows - 1);
  }
  return white;
}

void Expectation::solve(const VectorXd& y, const MatrixXd& x, const VectorXd& prior) {
  const Index runs = static_cast<Index>(begins_.size()) - 1;
  MatrixXd design = MatrixXd::Zero(y.size(), x.cols() + runs);
  design.leftCols(x.cols()) = x;
  for (Index r = 0; r < runs; ++r) {
    const auto at = static_cast<std::size_t>(r);
    design.col(x.cols() + r).segment(begins_[at], begins_[at + 1] - begins_[at]).setOnes();
  }
  const MatrixXd white = whitened(design);
  const VectorXd white_y = whitened(y);
  MatrixXd normal = white.transpose() * white;
  for (Index i = 0; i < x.cols(); ++i)
    normal(i, i) += sigma_ * sigma_ / (prior[i] * prior[i]) + 1e-12;
  for (Index i = x.cols(); i < normal.cols(); ++i)
    normal(i, i) += offset_prior_share * (1.0 + normal(i, i));
  const Eigen::LLT<MatrixXd> factor(normal);
  const VectorXd solution = factor.solve(white.transpose() * white_y);
  coefficients_ = solution.head(x.cols());
  expected_ = design * solution;
  remainder_ = y - expected_;
  innovations_ = white_y - white * solution;
  basis_ = factor.matrixL().solve(white.transpose()).transpose();
  // Outliers raise sigma above the robust deviation.
  const std::vector<double> innovations(innovations_.begin(), innovations_.end());
  sigma_ = std::max({robust_deviation(innovations), wild_share * spread(innovations_), 1e-9});
}

void Expectation::estimate_rho() {
  double with_next = 0.0;
  double squares = 0.0;
  for (std::size_t r = 0; r + 1 < begins_.size(); ++r) {
    for (Index row = begins_[r] + 1; row < begins_[r + 1]; ++row) {
      with_next += remainder_[row] * remainder_[row - 1];
      squares += remainder_[row - 1] * remainder_[row - 1];
    }
  }
  rho_ = squares > 0 ? std::clamp(with_next / squares, 0.0, rho_max) : 0.0;
}

VectorXd Expectation::whitened_shape(std::size_t run, const VectorXd& shape) const {
  VectorXd white = shape;
  white[0] *= std::sqrt(1.0 - rho_ * rho_);
  white.tail(shape.size() - 1) -= rho_ * shape.head(shape.size() - 1);
  static_cast<void>(run);
  return white;
}

std::vector<Expectation::Evidence> Expectation::steps(std::size_t run) const {
  const Index begin = begins_[run];
  const Index rows = begins_[run + 1] - begin;
  std::vector<Evidence> all(static_cast<std::size_t>(rows));
  VectorXd basis_behind = VectorXd::Zero(basis_.cols());
  double behind = 0.0;
  const double held = 1.0 - rho_;
  for (Index row = rows - 1; row > 0; --row) {
    const VectorXd along = basis_.row(begin + row).transpose() + held * basis_behind;
    const double count = static_cast<double>(rows - 1 - row);
    const double energy = 1.0 + count * held * held - along.squaredNorm();
    const double product = innovations_[begin + row] + held * behind;
    if (energy > 1e-3) {
      all[static_cast<std::size_t>(row)] = {product / (sigma_ * std::sqrt(energy)),
                                            product / energy};
    }
    basis_behind += basis_.row(begin + row).transpose();
    behind += innovations_[begin + row];
  }
  return all;
}

double Expectation::slow_share(std::size_t run, const VectorXd& rest) const {
  const Index rows = rest.size();
  const Index length = rows / batches;
  static_cast<void>(run);
  if (length < 2) return 1.0;
  double squares = 0.0;
  for (Index batch = 0; batch < batches; ++batch)
    squares += std::pow(rest.segment(batch * length, length).mean(), 2);
  const double slow = squares / static_cast<double>(batches) * static_cast<double>(length);
  return std::max(1.0, slow / (sigma_ * sigma_));
}

Expectation::Evidence Expectation::shape(std::size_t run, const VectorXd& shape,
                                         bool coloured) const {
  const Index begin = begins_[run];
  const VectorXd white = whitened_shape(run, shape);
  const auto basis = basis_.middleRows(begin, shape.size());
  const VectorXd along = basis.transpose() * white;
  const double energy = white.squaredNorm() - along.squaredNorm();
  if (!(energy > 1e-9 * white.squaredNorm())) return {};
  const auto innovations = innovations_.segment(begin, shape.size());
  Evidence evidence;
  const double product = white.dot(innovations);
  evidence.size = product / energy;
  evidence.z = product / (sigma_ * std::sqrt(energy));
  if (coloured) {
    const VectorXd rest = innovations - evidence.size * (white - basis * along);
    evidence.z /= std::sqrt(slow_share(run, rest));
  }
  return evidence;
}

Expectation::Evidence Expectation::second_shape(std::size_t run, const VectorXd& first,
                                                const VectorXd& second) const {
  const Index begin = begins_[run];
  MatrixXd white(first.size(), 2);
  white << whitened_shape(run, first), whitened_shape(run, second);
  const auto basis = basis_.middleRows(begin, first.size());
  const MatrixXd along = basis.transpose() * white;
  const Eigen::Matrix2d energy = white.transpose() * white - along.transpose() * along;
  const Eigen::Vector2d product = white.transpose() * innovations_.segment(begin, first.size());
  const double determinant = energy.determinant();
  if (!(determinant > 1e-9 * energy(0, 0) * energy(1, 1)) || !(energy(0, 0) > 1e-9)) return {};
  const Eigen::Vector2d size = energy.inverse() * product;
  const VectorXd rest = innovations_.segment(begin, first.size()) - (white - basis * along) * size;
  const double variance = sigma_ * sigma_ * slow_share(run, rest);
  const double both = product.dot(size) / variance;
  const double alone = product[0] * product[0] / energy(0, 0) / variance;
  return {std::sqrt(std::max(0.0, both - alone)), size[1]};
}

}  // namespace thermocomp::inspection
