/// Conditions for taking a reference: the machine must be at rest thermally and without an offset.
#pragma once

#include <string>
#include <vector>

#include "daemon/status/status_inputs.hpp"

namespace thermocomp {

/// The model's temperatures without a good sensor, one sentence each: no reference without them.
[[nodiscard]] std::vector<std::string> lost_for_reference(const StatusView& view);

/// The objections to a reference now, one sentence each: an axis is being proved, an offset is
/// applied, the controller is cutting, the machine warms or cools. Unknown quantities do not count
/// against it.
[[nodiscard]] std::vector<std::string> against_reference(const StatusView& view);

/// Time for which all temperatures have been watched [s]; slow warming needs half an hour.
[[nodiscard]] double watched_s(const StatusView& view);

}  // namespace thermocomp
