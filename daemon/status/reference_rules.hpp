/// Conditions for taking a reference: the machine must be at rest thermally and without an offset.
#pragma once

#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"
#include "daemon/status/warm_up.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

/// The model's temperatures without a good sensor, one sentence each; they prevent a reference.
[[nodiscard]] std::vector<std::string> lost_for_reference(const ThermalModel& model,
                                                          const Report& report);

/// The objections to taking a reference now, one sentence each: an axis is being proved, an offset
/// is applied, the controller is cutting, the machine warms or cools. Unknown quantities are no
/// objection.
/// @param trend  nullptr: temperatures are not watched
[[nodiscard]] std::vector<std::string> against_reference(const DaemonConfig& config,
                                                         const Report& report,
                                                         const ControllerHealth& controller,
                                                         const TemperatureTrend* trend);

/// The fastest change since the temperatures have been watched, "bed_degC +12.0 K/h"; empty:
/// steady.
[[nodiscard]] std::string change_since_start(const ThermalModel& model, const Report& report,
                                             const TemperatureTrend& trend);

/// Time for which all temperatures have been watched [s]; slow warming needs half an hour.
[[nodiscard]] double watched_s(const Report& report, const TemperatureTrend* trend);

}  // namespace thermocomp
