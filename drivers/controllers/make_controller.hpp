/// From a controller's configuration to its link.
#pragma once

#include <memory>
#include <vector>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"

namespace thermocomp {

/// @throws InvalidValue or DriverError for a configuration that cannot work
[[nodiscard]] std::unique_ptr<ControllerLink> make_controller(const ControllerConfig& config);

/// Per axis: how far apart two offsets are that the controller can be sent [um]; 0 where the
/// offset is sent as a float or to nobody.
[[nodiscard]] std::vector<double> offset_resolution_um(const ControllerConfig& config);

}  // namespace thermocomp
