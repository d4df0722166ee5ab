/// Configuration of thermocomp-uplink.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/text/problems.hpp"
#include "fleet/release/release_exchange.hpp"

namespace thermocomp::fleet {

struct UplinkSettings {
  std::string store;                           ///< complete connection string
  std::vector<std::filesystem::path> history;  ///< histories of the daemons on this computer
  ReleaseFiles releases;                       ///< files shared with `thermocomp admit`
  double period_s{60.0};                       ///< polling period
  double cpu_percent_max{1.0};                 ///< of one core, on average
};

/// @throws ConfigurationError with every problem: file, line, key, value, rule
[[nodiscard]] UplinkSettings load_uplink_settings(const std::filesystem::path& file);

}  // namespace thermocomp::fleet
