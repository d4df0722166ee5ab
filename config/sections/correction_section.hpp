/// [correction]: how measured displacements correct the model while it runs.
#pragma once

#include "config/toml/toml_reader.hpp"
#include "estimator/correction_config.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::sections {

[[nodiscard]] CorrectionConfig read_correction(const TomlTable& table);

/// Checks that every input of a group is one of the model, and in no other group.
void check_correction(const TomlTable& table, const CorrectionConfig& config,
                      const ThermalModel& model);

}  // namespace thermocomp::sections
