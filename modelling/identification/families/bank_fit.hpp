/// Penalised regression on every temperature and signal at several low passes, for machines whose
/// decisive sensors are unknown.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "estimator/thermal_model.hpp"
#include "modelling/identification/measured_tests.hpp"

namespace thermocomp::identification {

/// max(u - above, 0) of a signal u.
struct Hinge {
  std::string signal;
  double above{0.0};
};

/// Columns of a bank: each subject to its power, at each time constant; ordered by time constant,
/// then subject. Then the hinges.
struct BankColumns {
  std::vector<std::string> subjects;  ///< temperatures (rises), then signals, then their squares
  std::vector<double> powers;
  std::vector<double> taus_s;  ///< 0 first
  std::vector<Hinge> hinges;
  [[nodiscard]] std::size_t late() const noexcept { return subjects.size() * taus_s.size(); }
  [[nodiscard]] std::size_t size() const noexcept { return late() + hinges.size(); }
};

/// Time constants from 5 min, at least twice the step, in ratios of three up to half of the longest
/// run, with at most 600 columns. A signal with only the values 0 and 1 has no square. No hinges.
[[nodiscard]] BankColumns bank_columns(const MeasuredTests& tests);

/// Adds eight hinges per signal, evenly over its range; none if there would be more than 600
/// columns, nor for a signal that did not move or has at most six values, which the signal and its
/// square describe.
void add_hinges(const MeasuredTests& tests, BankColumns& columns);

/// Columns at some rows of a course, relative to the first of them; shape (rows, columns). Low
/// passes see every row of the course, and begin settled at its first.
[[nodiscard]] Eigen::MatrixXd bank_of(const TestRun& course, const MeasuredTests& tests,
                                      const BankColumns& columns,
                                      const std::vector<Eigen::Index>& rows);

/// Term for the daemon without hinges and without subjects of no gain, since the daemon requests
/// every signal of a term from the controller.
/// @param gains  [um per unit], shape (columns, outputs)
[[nodiscard]] TermSpec bank_term(const BankColumns& columns,
                                 const std::vector<std::string>& outputs,
                                 const Eigen::MatrixXd& gains);
/// One term per hinge with a gain.
[[nodiscard]] std::vector<TermSpec> hinge_terms(const BankColumns& columns,
                                                const std::vector<std::string>& outputs,
                                                const Eigen::MatrixXd& gains);

/// Undelayed temperatures as matrix, the rest as terms. @pre places are the first subjects
[[nodiscard]] ThermalModel bank_model(const std::vector<std::string>& places,
                                      const std::vector<std::string>& outputs,
                                      const BankColumns& columns, Eigen::MatrixXd gains);

/// X'X and X'Y of every fold, columns scaled to a standard deviation of 1. Rows with a missing
/// output (NaN) are left out.
class BankEquations {
 public:
  BankEquations(const MeasuredTests& tests, const BankColumns& columns);

  /// Gains [um per unit], shape (columns, outputs), from all folds but `left_out` (none: past the
  /// last): one regression with an L1 and a small L2 penalty. Both are fixed, since stretches of a
  /// record do not predict the best ones for another day (docs/measurements.md).
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
  std::vector<Eigen::MatrixXd> rows_;  ///< one per run
};

}  // namespace thermocomp::identification
