/// Why a step did not simply compensate, collected at its end.
#pragma once

#include <cstdint>

#include "estimator/axes/axis_bank.hpp"
#include "estimator/pipeline/mode_decision.hpp"
#include "estimator/step_values.hpp"

namespace thermocomp {

/// From all that the steps handed on.
/// @param written  by the controller's link, see ControllerState
/// @return a set of Reason
[[nodiscard]] std::uint32_t reasons_of(const Signals& signals, bool written,
                                       const Temperatures& temps, const ReferenceState& reference,
                                       const Displacement& displacement,
                                       const ModeDecision::State& mode, const Targets& targets,
                                       const AxisBank& axes) noexcept;

}  // namespace thermocomp
