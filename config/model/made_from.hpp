/// The table `[made_from]` of a model file.
#pragma once

#include <string>

#include "config/toml/toml_reader.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// @param model  without `made_from`, for its columns and outputs
[[nodiscard]] MadeFrom read_made_from(const TomlTable& table, const ThermalModel& model);
/// `[made_from]` and its tables. @pre the model has one
[[nodiscard]] std::string write_made_from(const ThermalModel& model);

}  // namespace thermocomp
