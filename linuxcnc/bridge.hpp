// SPDX-License-Identifier: GPL-2.0-or-later
/// The running bridge: HAL on one side, the daemon's socket on the other.
#pragma once

#include "linuxcnc/command_line.hpp"

namespace thermocomp_linuxcnc {

/// Exchanges until SIGTERM or SIGINT. @throws HalError at the start
void run_bridge(const BridgeOptions& options);

}  // namespace thermocomp_linuxcnc
