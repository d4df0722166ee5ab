/// Measured runs as the material of similarity and fit: rises over the reference, in tests that can
/// be left out one at a time.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/runs/run_file.hpp"

namespace thermocomp::identification {

/// One run from the row of its reference (the file's first row in which nothing is missing) to the
/// end of its selection; rows in which something is missing are left out.
struct TestRun {
  std::string name;
  Eigen::VectorXd time_s;
  Eigen::MatrixXd places_K;           ///< shape (rows, places): rise over the reference
  Eigen::MatrixXd outputs_um;         ///< shape (rows, outputs): change since the reference
  Eigen::MatrixXd signals;            ///< shape (rows, signals), as recorded
  Eigen::RowVectorXd reference_degC;  ///< of the places
  Eigen::Index begin{0};              ///< first selected row
};

/// What is left out as one: a whole run, or a stretch of the only run.
struct Fold {
  std::size_t run{0};
  Eigen::Index begin{0};
  Eigen::Index end{0};
};

/// Rows of the only run whose places, taken together, are further from the reference than in the
/// other half. Predicting them from the cooler half shows what an equation does beyond what it was
/// fitted to - as it must when the machine is loaded more than it was in the test.
struct HotHalf {
  std::vector<Eigen::Index> rows;  ///< empty: there are several tests, which serve for that
};

struct MeasuredTests {
  std::vector<std::string> places;
  std::vector<std::string> outputs;
  std::vector<std::string> signals;  ///< that all runs have and that vary
  /// Those that stay at a level within each run, or go up or down once in all: they get no gain,
  /// and what they do elsewhere is another state of the machine.
  std::vector<std::string> unmoved;
  std::vector<TestRun> runs;
  std::vector<Fold> folds;
  HotHalf hot;
  std::vector<std::string> notes;  ///< for a person: what was left out and why

  [[nodiscard]] Eigen::Index rows() const;  ///< selected ones of all runs
  [[nodiscard]] std::string fold_name(std::size_t fold) const;
  [[nodiscard]] bool moved(const std::string& signal) const;  ///< not among the unmoved
};

struct TestOptions {
  std::vector<std::string> places;   ///< empty: every temperature that all runs have
  std::vector<std::string> outputs;  ///< may be empty
  std::size_t folds_of_one_run{6};
  bool signals{false};  ///< operating signals too
  /// Rows without an output stay, after the first that has them all: temperatures between two
  /// probings, for low passes. Their outputs are NaN.
  bool between_probings{false};
};

/// A place that no run has a value of, or that moves in none, is left out with a note.
/// @throws ConfigurationError when a run lacks a column that was asked for, or has too few rows
[[nodiscard]] MeasuredTests measured_tests(const std::vector<RunFile>& runs,
                                           const TestOptions& options);

}  // namespace thermocomp::identification
