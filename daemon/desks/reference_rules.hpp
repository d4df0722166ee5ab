/// When a new reference may be taken: what would make it one of a state that is not the straight
/// machine.
#pragma once

#include <string>

#include "daemon/status/status_json.hpp"

namespace thermocomp {

/// Why no reference should be taken now: an axis is being proved, an offset is applied, the machine
/// warms or cools. Empty: nothing speaks against it. What is not known does not speak against it.
[[nodiscard]] std::string why_no_reference(const StatusView& view);

/// For how long all temperatures have been watched [s]: what less than half an hour can say about
/// slow warming is little.
[[nodiscard]] double watched_s(const StatusView& view);

}  // namespace thermocomp
