/// What a model takes from a run file: the same for `predict` and `diagnose`.
#pragma once

#include <optional>
#include <vector>

#include "config/runs/run_file.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// The columns point into the run file.
struct ModelInputs {
  std::vector<const std::vector<double>*> temperatures;  ///< order of temperature_columns()
  std::vector<const std::vector<double>*> signals;       ///< order of signal_columns()
  /// Of the temperatures: the model's own for its inputs where it has them, else the first value of
  /// the column.
  std::vector<double> reference_degC;
  std::vector<std::size_t> rows;  ///< of the file, those in which none of the columns is missing
};

/// @throws ConfigurationError when the run lacks a column, or a column needed as reference has no
///                            value
[[nodiscard]] ModelInputs model_inputs(const ThermalModel& model, const RunFile& run);

/// The first value that is not missing; nullopt: all are.
[[nodiscard]] std::optional<double> first_value(const std::vector<double>& column);

/// A row's time, for what is stepped from row to row.
[[nodiscard]] nanoseconds time_of_row(double time_s);

/// Whether a temperature has the name of the air around the machine: a word of it begins as one of
/// room, ambient, air, Raum, Luft, Umgebung, hall.
[[nodiscard]] bool is_called_like_a_room(std::string name);

}  // namespace thermocomp
