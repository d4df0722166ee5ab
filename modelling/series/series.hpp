/// The model of a type: what its machines have in common and how they scatter.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "estimator/thermal_model.hpp"
#include "modelling/series/statistics.hpp"

namespace thermocomp::series {

/// Of one output.
struct OutputSeries {
  Eigen::VectorXd mean;        ///< m [um per unit], one a column
  Eigen::MatrixXd covariance;  ///< of a further machine: S and that of m
  double remainder_um{0.0};
  double noise_time_s{0.0};
  double displacement_um{0.0};        ///< RMS of what moved
  std::vector<double> remainders_um;  ///< RMS that each machine's posterior leaves, in order

  [[nodiscard]] double density() const { return 2.0 * noise_time_s * remainder_um * remainder_um; }
};

struct Series {
  std::vector<std::string> machines;
  std::string past_of;  ///< the one machine whose own past it is; empty: of a type
  double hours{0.0};
  Columns columns;
  Eigen::MatrixXd moment;  ///< mean of x x' over all rows
  std::map<std::string, OutputSeries> outputs;
};

/// The scatter that is assumed beside that of the machines, counting as two of them: predictions of
/// sisters differ by this share of the displacement.
inline constexpr double scatter_default = 0.15;

/// @param scatter  nullopt: scatter_default, and one machine alone is refused
/// @throws std::runtime_error when machines do not fit together, or there is one only
[[nodiscard]] Series series_of(const std::vector<Statistics>& machines,
                               std::optional<double> scatter);

/// The same series after `years`: each output's prediction may have moved by `drift` of its
/// displacement a year, independently in each column.
[[nodiscard]] Series drifted(Series series, double drift, double years);
/// Last year's model as a prior: its matrix and banks are m; S is what it left and the drift, as
/// shares of the displacement.
/// @throws std::runtime_error when it has a term that is no bank, or no [made_from]
[[nodiscard]] Series series_of_model(const ThermalModel& model, const std::string& file,
                                     double drift, double years);

/// Of a machine.
struct Adapted {
  ThermalModel model;  ///< with [made_from]; its stated error from V and the remainder
  std::map<std::string, Coefficients> coefficients;  ///< over all columns of the series
};
/// @throws std::runtime_error when machine and series do not fit together
[[nodiscard]] Adapted adapted(const Series& series, const Statistics& machine,
                              const std::string& prior_name);

/// The machine's own past as the prior of its next runs: m = b, S = V and `drift`, a share of each
/// output's displacement.
/// @throws std::runtime_error when machine and series do not fit together
[[nodiscard]] Series own_series(const Series& prior, const Statistics& machine,
                                const std::string& prior_name, double drift);

/// What the prior and the rows came to, for a person or a program.
[[nodiscard]] std::string adapted_text(const Series& series, const Statistics& machine,
                                       const Adapted& adapted, bool json);

/// How far a machine is from its sisters, in one output.
struct Comparison {
  std::string output;
  Departure departure;
  double remainder_um{0.0};  ///< that its posterior leaves
  double median_um{0.0};     ///< of the sisters
  double deviations{0.0};    ///< in 1.4826 median absolute deviations of the sisters' logarithms
  double false_alarm{0.0};   ///< probability below which it departs
};
[[nodiscard]] std::vector<Comparison> compared(const Series& series, const Statistics& machine);

/// One false alarm a year where a machine is compared each night; its outputs share it.
inline constexpr double false_alarms_a_night = 1.0 / 365.0;
[[nodiscard]] bool departs(const Comparison& comparison);
[[nodiscard]] std::string comparison_text(const std::vector<Comparison>& comparisons);
/// Member "departure" of the answer of `inspect`.
[[nodiscard]] std::string comparison_json(const std::vector<Comparison>& comparisons);

[[nodiscard]] std::string write_series(const Series& series);
/// @throws ConfigurationError
[[nodiscard]] Series load_series(const std::filesystem::path& file);

/// A series file, or last year's model.
/// @param years  negative: 0 of a series, 1 of a model
[[nodiscard]] Series load_prior(const std::filesystem::path& file, double drift, double years);

}  // namespace thermocomp::series
