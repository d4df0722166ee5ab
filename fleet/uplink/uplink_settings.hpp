/// The configuration of thermocomp-uplink.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/text/problems.hpp"
#include "fleet/release/release_exchange.hpp"

namespace thermocomp::fleet {

struct UplinkSettings {
  std::string store;                           ///< connection, complete
  std::vector<std::filesystem::path> history;  ///< files of the daemon, or of daemons, here
  ReleaseFiles releases;                       ///< what `thermocomp admit` reads and writes
  double period_s{60.0};                       ///< asked for what is new so often
  double cpu_percent_max{1.0};                 ///< of one core, on average
};

/// @throws ConfigurationError with every problem: file, line, key, value, rule
[[nodiscard]] UplinkSettings load_uplink_settings(const std::filesystem::path& file);

}  // namespace thermocomp::fleet
