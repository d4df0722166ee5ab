/// The contract with the controller's side as a table: which registers or bits, in what unit, who
/// writes them.
#pragma once

#include <string>

#include "config/daemon/daemon_config.hpp"

namespace thermocomp::cli {

/// For a person who programs the PLC: every register (Modbus), every bit of a frame (CAN) that the
/// configuration names, first what the daemon writes, then what it reads; then bounds and times.
/// docs/controllers/plc.md says what each part must do. Addresses are 0-based, as on the wire.
[[nodiscard]] std::string register_table(const DaemonConfig& config);

}  // namespace thermocomp::cli
