/// Every temperature and signal at several low passes, with penalties: what to fit where nobody
/// knows which few sensors matter.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "estimator/thermal_model.hpp"
#include "modelling/identification/measured_tests.hpp"

namespace thermocomp::identification {

/// max(u - above, 0) of a signal.
struct Hinge {
  std::string signal;
  double above{0.0};
};

/// Columns of a bank: each subject to its power, at each time constant; subjects within a time
/// constant side by side. Then the hinges.
struct BankColumns {
  std::vector<std::string> subjects;  ///< temperatures (rises), then signals, then their squares
  std::vector<double> powers;
  std::vector<double> taus_s;  ///< 0 first
  std::vector<Hinge> hinges;
  [[nodiscard]] std::size_t late() const noexcept { return subjects.size() * taus_s.size(); }
  [[nodiscard]] std::size_t size() const noexcept { return late() + hinges.size(); }
};

/// Time constants by a ratio of three from 5 min up to half of the longest run, at least
/// twice the step; as many as leave no more than 600 columns. A signal that is only ever 0 or 1 has
/// no square. No hinges.
[[nodiscard]] BankColumns bank_columns(const MeasuredTests& tests);

/// Eight hinges a signal, evenly over its range; none where they would be more than 600 columns,
/// nor on a signal that did not move, or has at most six values, which its size and square say well
/// enough.
void add_hinges(const MeasuredTests& tests, BankColumns& columns);

/// The columns over all rows of a run, less their values at its first row; shape (rows, columns).
[[nodiscard]] Eigen::MatrixXd bank_of(const TestRun& run, const MeasuredTests& tests,
                                      const BankColumns& columns);

/// The term that the daemon evaluates, without the hinges and without subjects of no gain: the
/// daemon asks the controller for every signal that a term names.
/// @param gains  [um per unit], shape (columns, outputs)
[[nodiscard]] TermSpec bank_term(const BankColumns& columns,
                                 const std::vector<std::string>& outputs,
                                 const Eigen::MatrixXd& gains);
/// Those of the hinges that have a gain, one each.
[[nodiscard]] std::vector<TermSpec> hinge_terms(const BankColumns& columns,
                                                const std::vector<std::string>& outputs,
                                                const Eigen::MatrixXd& gains);

/// All of it: what acts at once is the matrix's, the rest one term. @pre places stand first
[[nodiscard]] ThermalModel bank_model(const std::vector<std::string>& places,
                                      const std::vector<std::string>& outputs,
                                      const BankColumns& columns, Eigen::MatrixXd gains);

/// X'X and X'Y of every fold, columns scaled to a standard deviation of 1. Rows in which an output
/// is missing (NaN) do not count.
class BankEquations {
 public:
  BankEquations(const MeasuredTests& tests, const BankColumns& columns);

  /// Gains [um per unit], shape (columns, outputs), from all folds but `left_out` (none: past the
  /// last): one regression with an L1 and a small L2 penalty. Both are fixed, since stretches of a
  /// record do not predict which is best on another day (docs/measurements.md).
  [[nodiscard]] Eigen::MatrixXd fit(std::size_t left_out) const;

  [[nodiscard]] const std::vector<Eigen::MatrixXd>& rows() const noexcept { return rows_; }

 private:
  struct Sums {
    Eigen::MatrixXd xx;
    Eigen::MatrixXd xy;
    Eigen::VectorXd yy;
    double rows{0.0};
  };
  std::vector<Sums> folds_;
  Eigen::VectorXd scale_;
  std::vector<Eigen::MatrixXd> rows_;  ///< one a run
};

}  // namespace thermocomp::identification
