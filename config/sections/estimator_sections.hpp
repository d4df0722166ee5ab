/// [screening], [smoothing], [[sensor]], [[block]], [[axis]] and [compensation].
#pragma once

#include <string>
#include <vector>

#include "config/toml/toml_reader.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::sections {

/// Names, reference sensors, screening and smoothing of the [[sensor]] tables, in order.
[[nodiscard]] std::vector<SensorConfig> read_sensors(const TomlTable& root,
                                                     const std::vector<TomlTable>& tables);

[[nodiscard]] std::vector<BlockConfig> read_blocks(const std::vector<TomlTable>& tables,
                                                   const std::vector<SensorConfig>& sensors);

/// Reads the axes without `offset` and `applied`, the keys for their places.
[[nodiscard]] std::vector<AxisConfig> read_axes(const std::vector<TomlTable>& tables);

/// @param signals  signals of the controller
[[nodiscard]] CompensationConfig read_compensation(const TomlTable& table,
                                                   const std::vector<std::string>& signals);

/// [correction]: correction of the model by measured displacements.
[[nodiscard]] CorrectionConfig read_correction(const TomlTable& table);

/// Checks that every input of a group is one of the model, and in one group only.
void check_correction(const TomlTable& table, const CorrectionConfig& config,
                      const ThermalModel& model);

}  // namespace thermocomp::sections
