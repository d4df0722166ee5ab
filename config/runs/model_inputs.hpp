/// The inputs of a model in a run file, for `predict` and `diagnose`.
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
  /// Temperatures: the model's reference if it has one, else the column's first value.
  std::vector<double> reference_degC;
  std::vector<std::size_t> rows;  ///< rows of the file without a missing value in the columns
};

/// @throws ConfigurationError when a column is missing, or one needed as reference has no value
[[nodiscard]] ModelInputs model_inputs(const ThermalModel& model, const RunFile& run);

/// The first value that is not missing; nullopt: none.
[[nodiscard]] std::optional<double> first_value(const std::vector<double>& column);

/// A row's time, for models that are stepped from row to row.
[[nodiscard]] nanoseconds time_of_row(double time_s);

/// Whether a temperature's name is that of the air around the machine: one of its words begins with
/// room, ambient, air, Raum, Luft, Umgebung or hall.
[[nodiscard]] bool is_called_like_a_room(std::string name);

}  // namespace thermocomp
