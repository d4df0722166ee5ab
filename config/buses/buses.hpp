/// [[bus]], [[device]] and where each [[sensor]] is found on them.
#pragma once

#include <span>
#include <vector>

#include "config/buses/bus_section.hpp"
#include "config/buses/presets.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/sensors/bus_config.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::sections {

/// The [[sensor]] tables in order, and what was read of them; their channels get these indices.
struct SensorTables {
  const std::vector<TomlTable>& tables;
  std::span<const SensorConfig> sensors;
};

/// @param presets, files  the caller reports their problems
/// @return by kind, those of one kind as in the file
[[nodiscard]] std::vector<BusConfig> read_buses(const TomlTable& root, const SensorTables& sensors,
                                                Presets& presets, BusFiles& files);

}  // namespace thermocomp::sections
