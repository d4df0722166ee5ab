/// Text formatted as by printf.
#pragma once

#include <string>

namespace thermocomp::identification {

/// At most 500 characters; longer text is truncated.
[[gnu::format(printf, 1, 2)]] std::string printed(const char* format, ...);

}  // namespace thermocomp::identification
