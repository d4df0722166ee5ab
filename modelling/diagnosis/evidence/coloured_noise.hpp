/// Residuals of thermal models wander: noise that is white plus a first-order wandering part. Data
/// whitened with it can be judged by ordinary least squares.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/data/block.hpp"
#include "modelling/diagnosis/data/panel.hpp"

namespace thermocomp::diagnosis {

/// Covariance of two rows: sigma^2 (1[i = j] + ratio exp(-|t_i - t_j| / tau_s)).
struct NoiseShape {
  double ratio{0.0};  ///< variance of the wandering part over that of the white one
  double tau_s{1.0};
};

/// The Kalman filter of the wandering part: its innovations, divided by their spread, are white.
/// The gains depend on the times alone, so that every column is whitened by the same few
/// multiplications a row.
class Whitener {
 public:
  /// @param present  rows without a value are left out: their whitened value is 0
  Whitener(const NoiseShape& shape, const Eigen::VectorXd& time_s, const std::vector<Block>& blocks,
           const Eigen::Array<bool, Eigen::Dynamic, 1>& present);

  [[nodiscard]] Eigen::VectorXd apply(const Eigen::VectorXd& column) const;
  /// The same for every column at once.
  [[nodiscard]] Panel apply(const Panel& columns) const;
  /// The same with the squares of each whitened column.
  /// @param squares  becomes of shape (1, columns)
  [[nodiscard]] Panel apply(const Panel& columns, Eigen::MatrixXd& squares) const;
  /// White noise, and no row without a value: apply() gives what it gets.
  [[nodiscard]] bool changes_nothing() const { return !wanders_ && scale_.isOnes(0.0); }
  /// The transposed of what apply() does: white' apply(x) = transposed(white)' x.
  [[nodiscard]] Panel transposed(const Panel& white) const;
  /// Sums of squares of each column, whitened and as it is, in one pass; each of shape (1,
  /// columns).
  struct Squares {
    Eigen::MatrixXd white;
    Eigen::MatrixXd plain;
  };
  [[nodiscard]] Squares squares(const Panel& columns) const;
  /// Sums of squares of whitened columns that are those of `whole` from a row on and zero before,
  /// without whitening each: shape (first rows, columns of whole).
  /// @param first_rows  ascending, one at least
  [[nodiscard]] Eigen::MatrixXd squares_from_rows(
      const Panel& whole, const std::vector<Eigen::Index>& first_rows) const;
  /// Logarithm of the determinant of the covariance, sigma = 1.
  [[nodiscard]] double log_determinant() const noexcept { return log_determinant_; }

 private:
  bool wanders_;
  Eigen::VectorXd keep_;   ///< factor of the state from the row before; 0 at a block's start
  Eigen::VectorXd gain_;   ///< 0 in rows without a value
  Eigen::VectorXd scale_;  ///< 1 / spread of the innovation; 0 in rows without a value
  /// The same with few steps from state to state: factors of the state before in the state after
  /// and in the whitened value.
  Eigen::VectorXd carried_;
  Eigen::VectorXd dropped_;
  double log_determinant_{0.0};
};

}  // namespace thermocomp::diagnosis
