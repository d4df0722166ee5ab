/// The tables `[course]` and `[made_from]` of a model file.
#pragma once

#include <string>

#include "config/toml/toml_reader.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// @param model  without `course`, for its inputs and outputs
[[nodiscard]] RecordedCourse read_course(const TomlTable& table, const ThermalModel& model);
/// `[course]` and its tables. @pre the model has one
[[nodiscard]] std::string write_course(const ThermalModel& model);

/// @param model  without `made_from`, for its columns and outputs
[[nodiscard]] MadeFrom read_made_from(const TomlTable& table, const ThermalModel& model);
/// `[made_from]` and its tables. @pre the model has one
[[nodiscard]] std::string write_made_from(const ThermalModel& model);

}  // namespace thermocomp
