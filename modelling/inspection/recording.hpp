/// All runs as matrices on a coarser grid, on which readings are compared with each other.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/runs/run_file.hpp"

namespace thermocomp::inspection {

/// Rows of all runs one after another. A missing temperature or signal is that of the row before;
/// a missing displacement is NaN.
struct Recording {
  std::vector<std::string> temps;
  std::vector<std::string> signals;
  std::vector<std::string> outputs;
  Eigen::VectorXd time_s;
  Eigen::MatrixXd temps_K;           ///< shape (rows, temps)
  Eigen::MatrixXd values;            ///< shape (rows, signals)
  Eigen::MatrixXd outputs_um;        ///< shape (rows, outputs)
  std::vector<Eigen::Index> begins;  ///< of each run, and the end
  /// Whether a gap ends in the row; shape (rows, temps + 1), last those in which rows are missing.
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> after_gap;

  [[nodiscard]] std::size_t runs() const noexcept { return begins.size() - 1; }
};

/// Columns that all runs have, and that have values in at least half of each run's rows
/// (displacements: in 20 rows). Thinned by means, so that each run has at most `rows_max` rows.
[[nodiscard]] Recording make_recording(const std::vector<RunFile>& runs, Eigen::Index rows_max);

/// First-order low pass of each column, started at each run's first row.
[[nodiscard]] Eigen::MatrixXd low_pass(const Recording& recording, const Eigen::MatrixXd& columns,
                                       double tau_s);

// Stretches of a recording without a row or a value.

/// From row to row [s].
[[nodiscard]] std::vector<double> steps_of(const RunFile& run);
/// Nine rows in ten are a step apart, give or take a fifth.
[[nodiscard]] bool is_regular(const std::vector<double>& steps, double step_s);
/// From how many seconds on a stretch without a value is a gap.
[[nodiscard]] double gap_s_min(const RunFile& run);
/// Rows of the first value after each gap of the column, be it that rows or its values are missing.
[[nodiscard]] std::vector<std::size_t> ends_of_gaps(const RunFile& run,
                                                    const std::vector<double>& column);

}  // namespace thermocomp::inspection
