/// From a controller's configuration to its link.
#pragma once

#include <memory>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"

namespace thermocomp {

/// @param dry_run  nothing is to be written: the link is a DryRunController around it
/// @throws InvalidValue or DriverError for a configuration that cannot work
[[nodiscard]] std::unique_ptr<ControllerLink> make_controller(const ControllerConfig& config,
                                                              bool dry_run = false);

}  // namespace thermocomp
