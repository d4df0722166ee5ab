/// What columns explain of rows that they were not fitted to.
#pragma once

#include <vector>

#include <Eigen/Cholesky>

#include "modelling/diagnosis/data/series.hpp"
#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

namespace thermocomp::diagnosis {

/// Each eighth of the rows is left out in turn: least squares on the others, of columns that are
/// accepted already and those that are tried.
class LeftOut {
 public:
  /// @param accepted  shape (rows, p)
  LeftOut(Column values, Panel accepted);

  /// Sum of the squares that are left of all eighths with the accepted columns alone.
  [[nodiscard]] double before() const { return before_; }
  /// The same with groups of `width` columns, one a group.
  /// @param bounds  of the gain where a group has one column
  [[nodiscard]] std::vector<double> after(const Panel& columns, Eigen::Index width,
                                          const Interval& bounds) const;
  /// What the accepted columns do not explain of columns, or of the values, over all rows.
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
