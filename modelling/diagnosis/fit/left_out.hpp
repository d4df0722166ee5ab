/// Cross-validation of columns.
#pragma once

#include <vector>

#include <Eigen/Cholesky>

#include "modelling/diagnosis/data/series.hpp"
#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

namespace thermocomp::diagnosis {

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
