/// Runs as data of a model: no row twice, no outliers (a missed probe, a misread row) of
/// displacement; the model's inputs.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// True if both have a selected row of one file in common (by its resolved path), or a quarter of
/// the shorter one is in the other: a copy, or overlapping exports of one history.
[[nodiscard]] bool share_rows(const RunFile& a, const RunFile& b);

/// Whether a model was made from rows of the run, by name; folders are ignored.
/// @param runs  MadeFrom::runs
[[nodiscard]] bool is_made_from(std::span<const std::string> runs, const std::string& run);

/// Refuses common rows of runs that are left out in turn or test one another.
/// @throws ConfigurationError naming the file
void refuse_overlap(std::span<const RunFile> runs);
/// Refuses common rows of training and test runs.
void refuse_overlap(std::span<const RunFile> train, std::span<const RunFile> test);

/// Outliers of one column of a run.
struct Outliers {
  std::string column;
  std::vector<double> times_s;
  double size_um{0.0};   ///< the largest deviation, with its sign
  double limit_um{0.0};  ///< limit of the deviation
  bool stuck{false};     ///< one value repeated; size_um: jump after it

  /// One line with number, column, times and size.
  [[nodiscard]] std::string text() const;
};

/// Sets outliers to missing. An outlier deviates from the median of its neighbours (four on each
/// side; at an end from a robust line through its neighbours) by more than twelve robust standard
/// deviations and a quarter (at an end half) of the column's range; of fewer than 60 values, by its
/// range (at an end ten times it). A step is not an outlier, since the values after it agree. A
/// column is stuck where it keeps one value for ten rows or more, three times as many as anywhere
/// else, and then jumps by more than a quarter of its range and twelve robust standard deviations
/// of its changes between rows.
/// @param columns  of displacement or tilt
std::vector<Outliers> leave_out_outliers(RunFile& run, const std::vector<std::string>& columns);

/// The columns point into the run file.
struct ModelInputs {
  std::vector<const std::vector<double>*> temperatures;  ///< order of temperature_columns()
  std::vector<const std::vector<double>*> signals;       ///< order of signal_columns()
  /// Temperatures: the model's reference if it has one, else the column's first value.
  std::vector<double> reference_degC;
  std::vector<std::size_t> rows;  ///< rows of the file without a missing value in the columns
};

/// @throws ConfigurationError when a column is missing, or one needed as reference has no value
[[nodiscard]] ModelInputs model_inputs(const ThermalModel& model, const RunFile& run);

/// The parts of exports in which a column of the model has no value, such as before the first
/// reading, are left out, with a line on stderr; never all of them.
void leave_out_empty_parts(const ThermalModel& model, std::vector<RunFile>& runs);

/// True if at most a fifth of the values are missing.
[[nodiscard]] bool is_mostly_known(const std::vector<double>& column);

/// The first value that is not missing; nullopt: none.
[[nodiscard]] std::optional<double> first_value(const std::vector<double>& column);

/// A row's time, for models that are stepped from row to row.
[[nodiscard]] nanoseconds time_of_row(double time_s);

/// True if a temperature's name is that of the air around the machine: one of its words begins with
/// room, ambient, air, Raum, Luft, Umgebung or hall.
[[nodiscard]] bool is_called_like_a_room(std::string name);

}  // namespace thermocomp
