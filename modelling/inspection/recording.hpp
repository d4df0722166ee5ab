/// All runs as matrices on a coarser grid for comparing readings.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/runs/run_file.hpp"

namespace thermocomp::inspection {

/// Rows of all runs. Missing temperatures and signals repeat the last one, displacements are NaN.
struct Recording {
  std::vector<std::string> temps;
  std::vector<std::string> signals;
  std::vector<std::string> outputs;
  Eigen::VectorXd time_s;
  Eigen::MatrixXd temps_K;           ///< shape (rows, temps)
  Eigen::MatrixXd values;            ///< shape (rows, signals)
  Eigen::MatrixXd outputs_um;        ///< shape (rows, outputs)
  std::vector<Eigen::Index> begins;  ///< first row of each run, and the end
  /// A gap ends in this row; shape (rows, temps + 1), the last column for missing rows.
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> after_gap;

  [[nodiscard]] std::size_t runs() const noexcept { return begins.size() - 1; }
};

/// Takes columns of all runs with values in at least half of each run's rows (displacements: in 20
/// rows). Averages them to at most `rows_max` rows per run.
[[nodiscard]] Recording make_recording(const std::vector<RunFile>& runs, Eigen::Index rows_max);

/// First-order low pass of each column, initialised at each run's first row.
[[nodiscard]] Eigen::MatrixXd low_pass(const Recording& recording, const Eigen::MatrixXd& columns,
                                       double tau_s);

// Gaps: stretches of a recording without a row or a value.

[[nodiscard]] std::vector<double> steps_of(const RunFile& run);
/// Nine of ten rows are one step apart, within a fifth.
[[nodiscard]] bool is_regular(const std::vector<double>& steps, double step_s);
/// Least duration of a gap without a value [s].
[[nodiscard]] double gap_s_min(const RunFile& run);
/// Rows of the first value after each gap of the column, with missing rows or values.
[[nodiscard]] std::vector<std::size_t> ends_of_gaps(const RunFile& run,
                                                    const std::vector<double>& column);

}  // namespace thermocomp::inspection
