/// Locks that allow only one daemon of this machine to write to a controller.
#pragma once

#include <string>
#include <vector>

#include "daemon/locks/locks.hpp"
#include "drivers/controllers/controller_config.hpp"

namespace thermocomp {

/// Lock names of the paths to the configured controller:
///   Modbus TCP   host, port and unit, as configured
///   Modbus RTU   the serial device, independent of its path
///   CAN          the interface and the identifier of each transmitted frame
/// Empty for a bridge, which calls this daemon's own socket.
/// @param dry_run  nothing is written: only a serial line is locked, since it has one master
[[nodiscard]] std::vector<std::string> controller_names(const ControllerConfig& config,
                                                        bool dry_run = false);

/// Controller name in the state file and the last-sent record.
[[nodiscard]] std::string controller_identity(const ControllerConfig& config);

/// @throws LockHeld, LockImpossible
[[nodiscard]] std::vector<NameLock> lock_controller(const ControllerConfig& config,
                                                    bool dry_run = false);

}  // namespace thermocomp
