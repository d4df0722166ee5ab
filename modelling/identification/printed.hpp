/// Text formatted as by printf.
#pragma once

#include <string>
#include <vector>

namespace thermocomp::identification {

/// At most 500 characters; longer text is truncated.
[[gnu::format(printf, 1, 2)]] std::string printed(const char* format, ...);

/// "a, b, c".
[[nodiscard]] std::string joined(const std::vector<std::string>& names);

}  // namespace thermocomp::identification
