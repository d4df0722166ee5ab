/// Puts the parts of the gateway together, and runs them until a signal ends them.
#pragma once

#include <string>

#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

/// @throws std::exception when a port cannot be had or a file cannot be used
void run_gateway(const GatewaySettings& settings);

/// The device file for the MTConnect agent, from what the running daemon has.
/// @throws ClientError where it does not answer
[[nodiscard]] std::string ask_device_file(const GatewaySettings& settings);

}  // namespace thermocomp::gateway
