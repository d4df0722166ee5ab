/// Sufficient statistics of one machine's runs: what a series needs of it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/runs/run_file.hpp"
#include "modelling/series/hierarchy.hpp"

namespace thermocomp::series {

/// A temperature or a signal, or a signal squared.
struct Subject {
  std::string name;
  double power{1.0};
  double low{0.0};  ///< as recorded
  double high{0.0};
  double rise_low{0.0};  ///< of a temperature over the reference; of a signal as `low`
  double rise_high{0.0};
  /// A signal: went up and down; one that does not in any machine gets no gain, since what it does
  /// cannot be told from what time does.
  bool moved{true};
};

/// Columns of X: each subject at each time constant, subjects within a time constant side by side.
struct Columns {
  std::vector<Subject> subjects;
  std::vector<double> taus_s;  ///< 0 first
  [[nodiscard]] Eigen::Index size() const {
    return static_cast<Eigen::Index>(subjects.size() * taus_s.size());
  }
  /// Index at time constant 0; -1: not there.
  [[nodiscard]] Eigen::Index find(const std::string& name, double power) const;
};

/// Low passes of every machine, the same everywhere, so that statistics can be added.
inline const std::vector<double> series_taus_s{0.0, 900.0, 3600.0, 14400.0};

struct Statistics {
  std::string machine;
  std::vector<std::string> runs;
  Columns columns;
  std::vector<std::string> outputs;
  double time_s{0.0};
  Eigen::MatrixXd xx;                ///< as Evidence; the same for all outputs
  Eigen::MatrixXd xy;                ///< shape (columns, outputs)
  Eigen::VectorXd yy;                ///< one an output
  std::vector<double> noise_time_s;  ///< of what a penalised fit leaves, one an output

  [[nodiscard]] Evidence evidence(std::size_t output) const;
};

/// Rises over each run's first row, through series_taus_s, and displacement since that row. A row
/// stands for the time to the next one, at most an hour. Of each run a constant is taken out as far
/// as half an hour of its rows does not contradict it: the first row has an error of its own.
/// @param outputs  empty: all that every run has
/// @throws ConfigurationError
[[nodiscard]] Statistics statistics_of(const std::vector<RunFile>& runs, std::string machine,
                                       std::vector<std::string> outputs,
                                       const std::vector<double>& taus_s,
                                       std::vector<std::string>& notes);

/// Statistics over the columns of a series. A column that the machine has not is, in the mean, what
/// the others make of it: x = T' x_seen, so xx = T' xx_seen T, with T from `moment`.
struct Seen {
  std::vector<Eigen::Index> columns;  ///< of the series, in order of `own`
  std::vector<Eigen::Index> own;      ///< of the statistics
  Eigen::MatrixXd map;                ///< T, shape (columns, all columns of the series)
};
/// @param moment  mean of x x' over the series, shape (all columns, all columns)
/// @throws std::runtime_error when the machine has none of the columns
[[nodiscard]] Seen seen_by(const Columns& machine, const Columns& series,
                           const Eigen::MatrixXd& moment);
[[nodiscard]] Evidence spread_out(const Evidence& evidence, const Seen& seen);

/// The statistics as a file, and read from it. @throws ConfigurationError
[[nodiscard]] std::string write_statistics(const Statistics& statistics);
[[nodiscard]] Statistics load_statistics(const std::filesystem::path& file);

}  // namespace thermocomp::series
