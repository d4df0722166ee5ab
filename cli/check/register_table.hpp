/// Interface to the controller as a table: registers or bits, units, direction.
#pragma once

#include <string>

#include "config/daemon/daemon_config.hpp"

namespace thermocomp::cli {

/// Lists for the PLC programmer every register (Modbus) or every bit of a frame (CAN) in the
/// configuration: written values, read values, bounds and times. docs/controllers/plc.md defines
/// the behaviour of each. Addresses are 0-based, as on the wire.
[[nodiscard]] std::string register_table(const DaemonConfig& config);

}  // namespace thermocomp::cli
