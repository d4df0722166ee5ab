/// A small good history, as the daemon's own writer makes it: the start of every damage.
#pragma once

#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"

namespace thermocomp::fuzz {

/// A configuration of two sensors and one axis with a dry run, and its model.
[[nodiscard]] std::string small_config_text();
[[nodiscard]] std::string small_model_text();
[[nodiscard]] DaemonConfig small_config();

/// The bytes of a SQLite file with two segments and some chunks, without a write-ahead log.
[[nodiscard]] std::vector<std::uint8_t> recorded_history();

}  // namespace thermocomp::fuzz
