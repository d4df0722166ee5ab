/// Selection of lags of the terms, d = K T + g (LP(T) - T), by left-out error.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "modelling/identification/equation/subset_search.hpp"
#include "modelling/identification/measured_tests.hpp"

namespace thermocomp::identification {

/// Column of the equation: rise T of a place, or with tau_s > 0 LP(T) - T.
struct FitColumn {
  std::size_t place{0};
  double tau_s{0.0};
};

/// Column over all rows of a run, computed by the estimator's low pass.
[[nodiscard]] Eigen::VectorXd column_of(const TestRun& run, const FitColumn& column);

/// Equations of each fold for all places and their lags at fixed time constants.
class ColumnPool {
 public:
  /// @param lags  number of time constants, with equal ratios; 0: none
  ColumnPool(const MeasuredTests& tests, std::size_t lags, double sensor_error_K);

  [[nodiscard]] const std::vector<FitColumn>& columns() const noexcept { return columns_; }
  [[nodiscard]] const std::vector<double>& taus_s() const noexcept { return taus_s_; }
  [[nodiscard]] const NormalEquations& equations() const noexcept { return equations_; }
  [[nodiscard]] std::size_t index_of(std::size_t place, std::size_t lag) const noexcept {
    return places_ + place * taus_s_.size() + lag;
  }
  [[nodiscard]] std::size_t places() const noexcept { return places_; }
  [[nodiscard]] std::size_t outputs() const noexcept { return outputs_; }

  /// Left-out sum of squares, shape (folds, outputs), of least squares with these columns on the
  /// other folds, without hot half and reading errors; NaN if singular.
  [[nodiscard]] Eigen::MatrixXd left_out(const std::vector<std::size_t>& columns) const;

 private:
  std::size_t places_;
  std::size_t outputs_;
  std::vector<double> taus_s_;
  std::vector<FitColumn> columns_;
  std::size_t tests_;  ///< number of folds without the hot half
  NormalEquations equations_;
};

struct LaggedSubset {
  std::vector<std::size_t> columns;  ///< of the pool: places first, then lags
  double score{0.0};                 ///< as Subset::score
};

/// Forward selection: the lag with the best left-out score joins if it reduces the score by a share
/// of `gain_min` and helps on more than half of the folds; one lag per place, only with 0 < g / K
/// <= 1 (for several outputs: taken together).
[[nodiscard]] LaggedSubset add_lags(const ColumnPool& pool, const std::vector<std::size_t>& places,
                                    double gain_min);

/// True if the score is lower after it on more than half of the folds.
[[nodiscard]] bool helps_on_most(const std::vector<double>& before,
                                 const std::vector<double>& after);

}  // namespace thermocomp::identification
