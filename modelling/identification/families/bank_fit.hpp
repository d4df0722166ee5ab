/// Every temperature and signal at several low passes, with penalties: what to fit where nobody
/// knows which few sensors matter.
#pragma once

#include <span>
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
/// nor on a signal of at most six values, which its size and square say well enough.
void add_hinges(const MeasuredTests& tests, BankColumns& columns);

/// The columns over all rows of a run, less their values at its first row; shape (rows, columns).
[[nodiscard]] Eigen::MatrixXd bank_of(const TestRun& run, const MeasuredTests& tests,
                                      const BankColumns& columns);

/// The term that the daemon evaluates, without the hinges.
/// @param gains  [um per unit], shape (columns, outputs)
[[nodiscard]] TermSpec bank_term(const BankColumns& columns,
                                 const std::vector<std::string>& outputs,
                                 const Eigen::MatrixXd& gains);
/// Those of the hinges, one each.
[[nodiscard]] std::vector<TermSpec> hinge_terms(const BankColumns& columns,
                                                const std::vector<std::string>& outputs,
                                                const Eigen::MatrixXd& gains);

/// X'X and X'Y of every fold, columns scaled between a standard deviation of 1 and 1 per kelvin.
/// Rows in which an output is missing (NaN) do not count.
class BankEquations {
 public:
  BankEquations(const MeasuredTests& tests, const BankColumns& columns);

  /// Gains [um per unit], shape (columns, outputs), from all folds but `left_out` (none: past the
  /// last). Half of them from ridge regression, half from L1 regression, in each an average over
  /// penalties. On measured machines neither kind is better than the other, and their mean is
  /// seldom worse than the better one.
  ///
  /// With four runs or more the runs choose: a penalty that leaves e^2 on runs left out inside
  /// counts as e^-8. Stretches of fewer runs share their loads, and predict penalties alike that
  /// part by several times on another day: a decade of them counts alike then, and L1 regression is
  /// a mean over records that lack a stretch each.
  [[nodiscard]] Eigen::MatrixXd fit(std::size_t left_out) const;

  [[nodiscard]] const std::vector<Eigen::MatrixXd>& rows() const noexcept { return rows_; }

 private:
  struct Sums {
    Eigen::MatrixXd xx;
    Eigen::MatrixXd xy;
    Eigen::VectorXd yy;
    double rows{0.0};
  };
  [[nodiscard]] Sums sums_without(std::size_t left_out, std::size_t also) const;
  /// Whether leaving the part out too takes something away, and not everything.
  [[nodiscard]] bool lacks_more(std::size_t left_out, std::size_t part) const;
  [[nodiscard]] static std::vector<Eigen::MatrixXd> ridge_path(const Sums& sums,
                                                               std::span<const double> penalties);
  /// @param prices  descending
  [[nodiscard]] static std::vector<Eigen::MatrixXd> l1_path(const Sums& sums,
                                                            std::span<const double> prices);
  [[nodiscard]] static std::vector<Eigen::MatrixXd> paths(const Sums& sums);
  [[nodiscard]] Eigen::MatrixXd chosen(std::size_t left_out) const;
  [[nodiscard]] Eigen::MatrixXd unchosen(std::size_t left_out) const;

  std::vector<Sums> pieces_;       ///< of the folds
  std::vector<std::size_t> fold_;  ///< of each piece
  std::vector<std::size_t> part_;  ///< of each piece: which are left out together inside
  std::size_t parts_{0};
  bool runs_choose_{false};
  Eigen::VectorXd scale_;
  std::vector<Eigen::MatrixXd> rows_;  ///< one a run
};

}  // namespace thermocomp::identification
