/// How far what a controller interpolates lies from the model's curve along a travel.
#pragma once

#include <string>

#include "config/daemon/daemon_config.hpp"

namespace thermocomp::cli {

/// A line for each axis whose controller interpolates: the largest deviation of the line or table
/// from the model, when each temperature alone is 10 K warmer and when all are. Empty: there is no
/// such axis.
[[nodiscard]] std::string travel_deviation_text(const DaemonConfig& config);

}  // namespace thermocomp::cli
