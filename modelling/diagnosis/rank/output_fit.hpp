/// Fits to one output's residual: likelihood under several noise models, with and without an
/// effect; cross-validation.
#pragma once

#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis {

/// Covariance of two rows of one run, s the standard deviation of the white part:
///
///   s^2 (delta(t - t') + ratio^2 exp(-|t - t'| / tau))
struct Background {
  double ratio{0.0};  ///< standard deviation of the correlated part over that of the white part
  double tau_s{1.0};
};

/// The columns minus their mean in each run.
[[nodiscard]] Panel centred_in(const std::vector<Block>& runs, Panel columns);

/// The backgrounds considered, with equal prior probability.
[[nodiscard]] const std::vector<Background>& backgrounds();

/// Replaces each column by its innovations of standard deviation s (a Kalman filter per run), shape
/// (rows, m).
/// @return ln of the determinant of the covariance over s^2
double whiten(const Background& background, const Column& time_s, const std::vector<Block>& runs,
              Panel& columns);

/// The rows in which an output has a value; of many rows, neighbours are averaged.
class OutputRows {
 public:
  /// @param present  over the stacked rows
  OutputRows(const StackedRows& rows, const Eigen::Array<bool, Eigen::Dynamic, 1>& present);

  [[nodiscard]] Eigen::Index size() const { return time_s_.size(); }
  [[nodiscard]] const Column& time_s() const { return time_s_; }
  [[nodiscard]] const std::vector<Block>& runs() const { return runs_; }
  /// @param columns  over the stacked rows, shape (rows, m)
  /// @return shape (size(), m)
  [[nodiscard]] Panel means_of(const Panel& columns) const { return means_ * columns; }

 private:
  Column time_s_;
  std::vector<Block> runs_;
  Eigen::SparseMatrix<double, Eigen::RowMajor> means_;
};

/// Normal equations of groups of columns, one group per shape, under each background.
struct Equations {
  Eigen::Index width{1};
  Eigen::MatrixXd right;   ///< columns' residual, shape (width shapes, backgrounds)
  Eigen::MatrixXd square;  ///< columns' columns within a group, shape (width^2 shapes, backgrounds)
  Eigen::MatrixXd size;    ///< mean square of centred columns, shape (width^2, shapes)

  [[nodiscard]] auto right_of(Eigen::Index shape, Eigen::Index under) const {
    return right.col(under).segment(width * shape, width);
  }
  [[nodiscard]] Eigen::MatrixXd square_of(Eigen::Index shape, Eigen::Index under) const {
    return square.col(under).segment(width * width * shape, width * width).reshaped(width, width);
  }
  /// Mean square of the group's columns times gains.
  [[nodiscard]] double size_of(Eigen::Index shape, const Eigen::VectorXd& gains) const {
    return gains.dot(size.col(shape).reshaped(width, width) * gains);
  }
};

/// Residual = common columns b + columns g + background, b with a normal prior of mean 0.
class OutputFit {
 public:
  /// @param remainder  one value a row
  /// @param common     shape (rows, p): part of every hypothesis
  /// @param sd         prior standard deviation of b; infinite: no prior
  /// @param least_noise  of a single value
  OutputFit(OutputRows rows, Column remainder, const Panel& common, const Eigen::VectorXd& sd,
            double least_noise);

  [[nodiscard]] const OutputRows& rows() const { return rows_; }
  [[nodiscard]] const Column& remainder() const { return remainder_; }
  /// Standard deviation of a row's white noise, from second differences.
  [[nodiscard]] double noise() const { return noise_; }
  /// The same after subtraction of an effect, which may change quickly.
  [[nodiscard]] double noise_beside(const Column& effect) const;
  /// @param columns  of the output's rows, `width` neighbours a group
  [[nodiscard]] Equations equations(const Panel& columns, Eigen::Index width) const;
  /// ln L under a background with an effect that reduces the squares by `explained` and has this
  /// mean square. The variance is at least that of the model discrepancy, a share of the effect, so
  /// that an approximate form of a large effect is not rejected.
  [[nodiscard]] double log_likelihood(Eigen::Index under, double explained,
                                      double effect_square) const;
  /// ln of the mean likelihood over all backgrounds without an effect.
  [[nodiscard]] double log_likelihood_of_none() const { return none_; }
  /// Variance of the white part under a background with an effect that explains these squares.
  [[nodiscard]] double variance(Eigen::Index under, double explained) const;
  /// Estimate of b under the likeliest background.
  [[nodiscard]] Eigen::VectorXd common_factors() const;

 private:
  struct Under {
    Panel white;                       ///< residual, common columns
    Eigen::LLT<Eigen::MatrixXd> root;  ///< of the common columns' products plus prior
    Eigen::VectorXd common_remainder;  ///< root^-1 common' residual
    double squares{0.0};               ///< of the residual after the fit of the common columns
    double log_determinant{0.0};
  };

  OutputRows rows_;
  Column remainder_;
  double least_noise_{0.0};
  double noise_{0.0};
  double none_{0.0};
  std::vector<Under> under_;
};

/// ln of the mean of exp(values).
[[nodiscard]] double log_mean_exp(const Eigen::VectorXd& values);

/// Leaves out each eighth of the rows in turn; least squares of accepted and tried columns on the
/// other rows.
class LeftOut {
 public:
  /// @param accepted  shape (rows, p)
  LeftOut(Column values, Panel accepted);

  /// Sum of squared residuals of all eighths with the accepted columns only.
  [[nodiscard]] double before() const { return before_; }
  /// The same with each group of `width` columns in addition.
  /// @param bounds  of the gain if a group has one column
  [[nodiscard]] std::vector<double> after(const Panel& columns, Eigen::Index width,
                                          const Interval& bounds) const;
  /// Residual of columns, or of the values, from a fit of the accepted columns to all rows.
  [[nodiscard]] Panel beside_accepted(const Panel& columns) const;
  [[nodiscard]] const Column& values() const { return values_; }

 private:
  struct Eighth {
    Eigen::Index begin{0};
    Eigen::Index count{0};
    Eigen::LLT<Eigen::MatrixXd> others;  ///< products of the accepted columns in the other rows
    Eigen::VectorXd factors;             ///< of the accepted columns alone
  };
  [[nodiscard]] static Eigen::LLT<Eigen::MatrixXd> rooted(Eigen::MatrixXd products);

  Column values_;
  Panel accepted_;
  Eigen::LLT<Eigen::MatrixXd> all_;
  std::vector<Eighth> eighths_;
  double before_{0.0};
};

}  // namespace thermocomp::diagnosis
