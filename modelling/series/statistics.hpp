/// Sufficient statistics of one machine's runs for a series.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/runs/run_file.hpp"
#include "modelling/series/hierarchy.hpp"

namespace thermocomp::series {

/// A temperature, a signal, or a signal squared.
struct Subject {
  std::string name;
  double power{1.0};
  double low{0.0};  ///< lowest recorded value
  double high{0.0};
  double rise_low{0.0};  ///< rise of a temperature over the reference; `low` for a signal
  double rise_high{0.0};
  /// A signal: has changed up and down. A signal that has not in any machine gets no gain, since
  /// its effect cannot be separated from a drift.
  bool moved{true};
};

/// Columns of X: each subject at each time constant, ordered by time constant, then subject.
struct Columns {
  std::vector<Subject> subjects;
  std::vector<double> taus_s;  ///< begins with 0
  [[nodiscard]] Eigen::Index size() const {
    return static_cast<Eigen::Index>(subjects.size() * taus_s.size());
  }
  /// Index at time constant 0; -1: absent.
  [[nodiscard]] Eigen::Index find(const std::string& name, double power) const;
};

/// Time constants of the low passes, equal for all machines, so that statistics can be summed.
inline const std::vector<double> series_taus_s{0.0, 900.0, 3600.0, 14400.0};

struct Statistics {
  std::string machine;
  std::vector<std::string> runs;
  Columns columns;
  std::vector<std::string> outputs;
  double time_s{0.0};
  Eigen::MatrixXd xx;                ///< as in Evidence; common to all outputs
  Eigen::MatrixXd xy;                ///< shape (columns, outputs)
  Eigen::VectorXd yy;                ///< by output
  std::vector<double> noise_time_s;  ///< of a penalised fit's remainder, by output

  [[nodiscard]] Evidence evidence(std::size_t output) const;
};

/// Rises since each run's first row, filtered by series_taus_s, and displacement since that row. A
/// row has the weight of the time to the next one, at most an hour. A constant per run, with a
/// prior worth half an hour of rows, is removed, since the first row has an error of its own.
/// @param outputs  empty: all outputs that every run has
/// @throws ConfigurationError
[[nodiscard]] Statistics statistics_of(const std::vector<RunFile>& runs, std::string machine,
                                       std::vector<std::string> outputs,
                                       const std::vector<double>& taus_s,
                                       std::vector<std::string>& notes);

/// Statistics over the columns of a series. A missing column is replaced by its expectation from
/// the others: x = T' x_seen, so xx = T' xx_seen T, with T from `moment`.
struct Seen {
  std::vector<Eigen::Index> columns;  ///< in the series, in the order of `own`
  std::vector<Eigen::Index> own;      ///< in the statistics
  Eigen::MatrixXd map;                ///< T, shape (columns, all columns of the series)
};
/// @param moment  mean of x x' over the series, shape (all columns, all columns)
/// @throws std::runtime_error if the machine has none of the columns
[[nodiscard]] Seen seen_by(const Columns& machine, const Columns& series,
                           const Eigen::MatrixXd& moment);
[[nodiscard]] Evidence spread_out(const Evidence& evidence, const Seen& seen);

/// Writes and reads a file of statistics. @throws ConfigurationError
[[nodiscard]] std::string write_statistics(const Statistics& statistics);
[[nodiscard]] Statistics load_statistics(const std::filesystem::path& file);

}  // namespace thermocomp::series
