/// Who else has a serial port open.
#pragma once

#include <string>

namespace thermocomp::cli {

struct SerialHolder {
  std::string name;       ///< "thermocompd (process 812)"; empty: nobody, or it cannot be seen
  bool is_daemon{false};  ///< thermocompd
};

/// Looks through the processes that the user may look into.
[[nodiscard]] SerialHolder holder_of(const std::string& device);

}  // namespace thermocomp::cli
