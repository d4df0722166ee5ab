/// When a new reference may be taken: only while nothing says that the machine is not straight.
#pragma once

#include <string>

#include "daemon/status/status_view.hpp"

namespace thermocomp {

/// Why no reference should be taken now: an axis is being proved, an offset is applied, the machine
/// warms or cools. Empty: nothing speaks against it, and what is not known does not either.
[[nodiscard]] std::string why_no_reference(const StatusView& view);

/// For how long all temperatures have been watched [s]; less than half an hour says little about
/// slow warming.
[[nodiscard]] double watched_s(const StatusView& view);

}  // namespace thermocomp
