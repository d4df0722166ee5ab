/// Text by printf's rules.
#pragma once

#include <string>

namespace thermocomp::identification {

/// At most 500 characters; the rest is cut off.
[[gnu::format(printf, 1, 2)]] std::string printed(const char* format, ...);

}  // namespace thermocomp::identification
