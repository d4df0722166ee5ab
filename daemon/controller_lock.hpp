/// Only one daemon of this machine writes to a controller.
#pragma once

#include <string>
#include <vector>

#include "daemon/locks/locks.hpp"
#include "drivers/controllers/controller_config.hpp"

namespace thermocomp {

/// The ways by which the configuration's controller is reached, as names to lock:
///   Modbus TCP   host, port and unit, as they are written
///   Modbus RTU   the serial device, whatever its path
///   CAN          the interface and the identifier of each frame that we send
/// None for a bridge: whoever calls the status socket of this daemon calls no other.
/// @param dry_run  nothing is written: only a serial line, which has one master, is named
[[nodiscard]] std::vector<std::string> controller_names(const ControllerConfig& config,
                                                        bool dry_run = false);

/// The controller as the state file and the last-sent record name it.
[[nodiscard]] std::string controller_identity(const ControllerConfig& config);

/// @throws LockHeld, LockImpossible
[[nodiscard]] std::vector<NameLock> lock_controller(const ControllerConfig& config,
                                                    bool dry_run = false);

}  // namespace thermocomp
