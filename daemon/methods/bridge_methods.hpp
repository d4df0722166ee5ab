/// The method `controller_state`: from a bridge's JSON to its report, and the answer.
#pragma once

#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "drivers/controllers/kinds/bridge_controller.hpp"

namespace thermocomp {

/// params: {"session": whole number from 1, "taking": true, "applied_um": {"x": 1.5, "y": null},
/// "signals": {"x_mm": 10.0, ...}}. Numbers are finite, null is "not known". Every axis of the
/// configuration must be there; further axes and signals are what others may want.
/// result: {"epoch": 3, "anew": false, "mode": "compensating", "offsets_um": {"x": 1.5, "y": null}}
/// where null is "leave it as it is".
/// @param mode  as a status calls it
/// @throws RpcError invalid_params (counted), refused
[[nodiscard]] nlohmann::json answer_bridge(BridgeController& bridge,
                                           const BridgeControllerConfig& config,
                                           std::string_view mode, const nlohmann::json& params);

}  // namespace thermocomp
