/// A small valid history written by the daemon's own writer, to be damaged.
#pragma once

#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"

namespace thermocomp::fuzz {

/// A configuration with two sensors and one axis in dry run, and its model.
[[nodiscard]] std::string small_config_text();
[[nodiscard]] std::string small_model_text();
[[nodiscard]] DaemonConfig small_config();

/// The bytes of a SQLite file with two segments and several chunks, without a write-ahead log.
[[nodiscard]] std::vector<std::uint8_t> recorded_history();

}  // namespace thermocomp::fuzz
