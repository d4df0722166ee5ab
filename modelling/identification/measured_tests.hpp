/// Measured runs as input of similarity and fit: rises over the reference, split into tests that
/// can be left out one at a time.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/runs/run_file.hpp"

namespace thermocomp::identification {

/// One run from its reference row (the file's first row without missing values) to the end of its
/// selection; rows with missing values are left out.
struct TestRun {
  std::string name;
  Eigen::VectorXd time_s;
  Eigen::MatrixXd places_K;           ///< shape (rows, places): rise over the reference
  Eigen::MatrixXd outputs_um;         ///< shape (rows, outputs): change since the reference
  Eigen::MatrixXd signals;            ///< shape (rows, signals), as recorded
  Eigen::RowVectorXd reference_degC;  ///< of the places
  Eigen::Index begin{0};              ///< first selected row
};

/// Rows that are left out together: a whole run, or a stretch of the only run.
struct Fold {
  std::size_t run{0};
  Eigen::Index begin{0};
  Eigen::Index end{0};
};

/// Half of the rows of a single run with the larger sum of absolute rises. Predicting it from the
/// other half shows how an equation extrapolates to higher loads than those of the fit.
struct HotHalf {
  std::vector<Eigen::Index> rows;  ///< empty with several tests, which show the same
};

struct MeasuredTests {
  std::vector<std::string> places;
  std::vector<std::string> outputs;
  std::vector<std::string> signals;   ///< common to all runs, and varying
  std::vector<std::string> constant;  ///< signals with one value in all rows: not in the model
  /// Signals that stay at a level within each run, or change in one direction once in all runs:
  /// they get no gain.
  std::vector<std::string> unmoved;
  /// Those of `unmoved` that change gradually, like a charge: see fit_families().
  std::vector<std::string> gradual;
  std::vector<TestRun> runs;
  /// `runs` with the rows before the first and between two probings, outputs NaN there; rises over
  /// its first row, changes of outputs since the first probing.
  std::vector<TestRun> between;
  std::vector<std::size_t> given;  ///< number of each run among those given
  std::vector<Fold> folds;
  HotHalf hot;
  std::vector<std::string> notes;  ///< what was left out and why

  [[nodiscard]] Eigen::Index rows() const;  ///< selected rows of all runs
  [[nodiscard]] std::string fold_name(std::size_t fold) const;
  [[nodiscard]] bool moved(const std::string& signal) const;  ///< not among the unmoved
  /// The run with all rows that low passes need: that of `between`, if there.
  [[nodiscard]] const TestRun& course(std::size_t run) const;
  /// Rows of the course that are those of the run.
  [[nodiscard]] std::vector<Eigen::Index> rows_in_course(std::size_t run) const;
};

struct TestOptions {
  std::vector<std::string> places;   ///< empty: every temperature that all runs have
  std::vector<std::string> outputs;  ///< may be empty
  std::size_t folds_of_one_run{6};
  bool signals{false};  ///< include operating signals
  /// `runs` are as `between`.
  bool between_probings{false};
};

/// Leaves out, with a note, places and signals that a run lacks or mostly lacks, and places that
/// never move.
/// @throws ConfigurationError if a run lacks a requested column or has too few rows
[[nodiscard]] MeasuredTests measured_tests(const std::vector<RunFile>& runs,
                                           const TestOptions& options);

}  // namespace thermocomp::identification
