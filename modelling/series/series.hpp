/// Model of a type: common mean of its machines, and their scatter.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "estimator/thermal_model.hpp"
#include "modelling/series/statistics.hpp"

namespace thermocomp::identification {
struct MeasuredTests;
}

namespace thermocomp::series {

struct OutputSeries {
  Eigen::VectorXd mean;        ///< m [um per unit], by column
  Eigen::MatrixXd covariance;  ///< of a further machine: S plus that of m
  double remainder_um{0.0};
  double noise_time_s{0.0};
  double displacement_um{0.0};        ///< RMS displacement
  std::vector<double> remainders_um;  ///< RMS remainder of each machine's posterior

  [[nodiscard]] double density() const { return 2.0 * noise_time_s * remainder_um * remainder_um; }
};

struct Series {
  std::vector<std::string> machines;
  std::string past_of;            ///< machine of an own past; empty: series of a type
  std::vector<std::string> runs;  ///< that a model as prior was made from; else empty
  double hours{0.0};
  Columns columns;
  Eigen::MatrixXd moment;  ///< mean of x x' over all rows
  std::map<std::string, OutputSeries> outputs;
};

/// Assumed scatter of sisters' predictions as a share of the displacement; weighs two machines.
inline constexpr double scatter_default = 0.15;

/// @param scatter  nullopt: scatter_default, and a single machine is refused
/// @throws std::runtime_error if machines do not fit together, or there is only one
[[nodiscard]] Series series_of(const std::vector<Statistics>& machines,
                               std::optional<double> scatter);

/// The series after `years`: each output's prediction may have drifted by `drift` of its
/// displacement a year, independently by column.
[[nodiscard]] Series drifted(Series series, double drift, double years);
/// Last year's model as a prior: m from its matrix and banks, S from its remainder and the drift.
/// @throws std::runtime_error if it has a term other than a bank, or no [made_from]
[[nodiscard]] Series series_of_model(const ThermalModel& model, const std::string& file,
                                     double drift, double years);

struct Adapted {
  ThermalModel model;  ///< with [made_from]; stated error from V and the remainder
  std::map<std::string, Coefficients> coefficients;  ///< over all columns of the series
};
/// @throws std::runtime_error if machine and series do not fit together
[[nodiscard]] Adapted adapted(const Series& series, const Statistics& machine,
                              const std::string& prior_name);

/// RMS on left-out runs, of a single run on each half by the other; one value per output.
struct PriorJudgement {
  std::vector<double> prior_um;  ///< the prior, adapted to the rest; empty: too few rows to judge
  std::vector<double> own_um;    ///< the machine's own fit
  std::vector<double> none_um;

  /// True if the prior leaves less than no model of every output, and a tenth less in geometric
  /// mean.
  [[nodiscard]] bool holds() const;
  /// Reason to compare the two later, not to choose: all four measured machines with this result on
  /// the first part of a run had the smaller error with the prior on the rest.
  [[nodiscard]] bool own_is_better() const;
  [[nodiscard]] std::string text(const std::vector<std::string>& outputs) const;
};
/// @param runs, tests  the same runs
[[nodiscard]] PriorJudgement judged(const Series& prior, const std::vector<RunFile>& runs,
                                    const identification::MeasuredTests& tests,
                                    const ThermalModel& own, const std::string& prior_name);

/// A machine's own past as a prior: m = b, S = V plus `drift`, a share of the displacement.
/// @throws std::runtime_error if machine and series do not fit together
[[nodiscard]] Series own_series(const Series& prior, const Statistics& machine,
                                const std::string& prior_name, double drift);

/// Result of prior and rows, as text or JSON.
[[nodiscard]] std::string adapted_text(const Series& series, const Statistics& machine,
                                       const Adapted& adapted, const PriorJudgement& judgement,
                                       bool json);

/// Departure of a machine from its sisters in one output.
struct Comparison {
  std::string output;
  Departure departure;
  double remainder_um{0.0};  ///< remainder of its posterior
  double median_um{0.0};     ///< of the sisters' remainders; 0: fewer than three
  double deviations{0.0};    ///< in 1.4826 median absolute deviations of the sisters' logarithms
  double false_alarm{0.0};   ///< probability threshold of a departure
};
[[nodiscard]] std::vector<Comparison> compared(const Series& series, const Statistics& machine);

/// One false alarm a year with one comparison each night, shared by the outputs.
inline constexpr double false_alarms_a_night = 1.0 / 365.0;
[[nodiscard]] bool departs(const Comparison& comparison);
[[nodiscard]] std::string comparison_text(const std::vector<Comparison>& comparisons);
/// Member "departure" of `inspect`'s JSON.
[[nodiscard]] std::string comparison_json(const std::vector<Comparison>& comparisons);

[[nodiscard]] std::string write_series(const Series& series);
/// @throws ConfigurationError
[[nodiscard]] Series load_series(const std::filesystem::path& file);

/// Loads a series file or last year's model.
/// @param years  negative: 0 for a series, 1 for a model
[[nodiscard]] Series load_prior(const std::filesystem::path& file, double drift, double years);

}  // namespace thermocomp::series
