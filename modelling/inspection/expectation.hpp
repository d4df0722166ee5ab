/// Expectation of a reading from all others and its own past, and evidence of deviations: change
/// points in the remainder, whitened by its own measured colour.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace thermocomp::inspection {

/// Standard deviation; 0 for fewer than two values.
[[nodiscard]] double spread(const Eigen::Ref<const Eigen::VectorXd>& values);

/// y = X b + an offset per run + n, n_t = rho n_(t-1) + white, with priors b_i ~ N(0, prior_i^2):
/// ridge regression on whitened rows, rho from the remainder. The evidence of a fault's shape f is
/// f'Mr / (sigma sqrt(f'Mf)), where the projection M removes what the regression can explain; a
/// shape that the neighbours can imitate is no evidence.
class Expectation {
 public:
  /// @param y       shape (rows)
  /// @param x       shape (rows, columns)
  /// @param prior   shape (columns): standard deviation of each coefficient
  /// @param begins  first row of each run, and the end
  Expectation(const Eigen::VectorXd& y, const Eigen::MatrixXd& x, const Eigen::VectorXd& prior,
              const std::vector<Eigen::Index>& begins);

  struct Evidence {
    double z{0.0};     ///< in standard deviations
    double size{0.0};  ///< in units of y per unit of the shape
  };
  /// Evidence of a step at each row of a run, in O(rows columns) for all. Shape (rows of the run).
  [[nodiscard]] std::vector<Evidence> steps(std::size_t run) const;
  /// Evidence of a shape on a run's rows (zero elsewhere). `coloured`: includes the remainder's
  /// slow part, which is not whitened (batch means).
  [[nodiscard]] Evidence shape(std::size_t run, const Eigen::VectorXd& shape, bool coloured) const;
  /// Evidence of the second of two shapes fitted together; z: root of its gain in 2 ln L.
  [[nodiscard]] Evidence second_shape(std::size_t run, const Eigen::VectorXd& first,
                                      const Eigen::VectorXd& second) const;

  [[nodiscard]] const Eigen::VectorXd& expected() const noexcept { return expected_; }
  [[nodiscard]] const Eigen::VectorXd& remainder() const noexcept { return remainder_; }
  [[nodiscard]] const Eigen::VectorXd& coefficients() const noexcept { return coefficients_; }
  [[nodiscard]] double rho() const noexcept { return rho_; }

 private:
  [[nodiscard]] Eigen::MatrixXd whitened(const Eigen::MatrixXd& columns) const;
  void solve(const Eigen::VectorXd& y, const Eigen::MatrixXd& x, const Eigen::VectorXd& prior);
  void estimate_rho();
  [[nodiscard]] Eigen::VectorXd whitened_shape(std::size_t run, const Eigen::VectorXd& shape) const;
  [[nodiscard]] double slow_share(std::size_t run, const Eigen::VectorXd& rest) const;

  std::vector<Eigen::Index> begins_;
  double rho_{0.0};
  double sigma_{1.0};
  Eigen::VectorXd coefficients_;
  Eigen::VectorXd expected_;
  Eigen::VectorXd remainder_;
  Eigen::VectorXd innovations_;  ///< whitened remainder
  Eigen::MatrixXd basis_;        ///< shape (rows, columns + runs): Q of the regression
};

}  // namespace thermocomp::inspection
